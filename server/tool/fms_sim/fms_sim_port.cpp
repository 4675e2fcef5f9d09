// SPDX-License-Identifier: Apache-2.0
#include "tool/fms_sim/fms_sim_port.hpp"

#include <fmt/format.h>
#include <sys/socket.h>

#include <cstdlib>
#include <span>
#include <string_view>
#include <utility>

#include "axes/acutrol_answer.hpp"
#include "axes/acutrol_table.hpp"
#include "axes/axes_memory.hpp"
#include "net/socket.hpp"
#include "tool/support/console.hpp"

namespace emit::tool {
namespace {

using protocol::AxesCommand;
using protocol::AxesFault;
using protocol::AxesMonitor;
using server::IoResult;
using server::IoStatus;

/// A host's clock that is farther off is worth a warning.
constexpr std::int64_t kOtherClockNs = 1'000'000'000;

/// Counts what is no command, and tells of the first one.
void refuse(AxesFault fault, std::string_view what, FmsSimFigures& figures) {
  if (figures.malformed++ == 0) {
    warn(fmt::format("{} is no command: {}", what, protocol::to_string(fault)));
  }
}

/// Hands a command to the table. Returns false if the table drops it.
bool hand_over(const AxesCommand& command, server::TableSimulator& table, std::int64_t now_ns,
               FmsSimFigures& figures) {
  if (!table.take(command, now_ns)) {
    ++figures.dropped;
    return false;
  }
  if (figures.commands++ == 0 && std::abs(command.time_ns - now_ns) > kOtherClockNs) {
    warn("the host's clock and this one differ by more than a second: demands hold on CLOCK_TAI");
  }
  if (figures.last_counter != 0 && command.counter > figures.last_counter) {
    figures.missing += command.counter - figures.last_counter - 1;
  }
  figures.last_counter = command.counter;
  return true;
}

physics::Result<server::SocketAddress> address_of(const std::string& listen,
                                                  server::Transport transport) {
  const auto where = server::parse_host_port(listen);
  if (!where) {
    return physics::make_error(physics::ErrorCode::invalid_argument, where.error().text);
  }
  return server::resolve(*where, transport, true);
}

class UdpPort final : public FmsSimPort {
 public:
  explicit UdpPort(server::UdpSocket socket) : socket_(std::move(socket)) {}
  [[nodiscard]] std::string name() const override {
    return "axes_udp=" + server::to_string(socket_.local_address());
  }
  void take(server::TableSimulator& table, std::int64_t now_ns, FmsSimFigures& figures) override {
    constexpr int kMostCommands = 64;
    for (int i = 0; i < kMostCommands; ++i) {
      std::array<std::byte, protocol::kMaxAxesBytes + 1> space;
      server::SocketAddress from;
      from.length = sizeof(from.storage);
      const ssize_t size = ::recvfrom(socket_.fd(), space.data(), space.size(), MSG_DONTWAIT,
                                      from.get(), &from.length);
      if (size < 0) return;
      AxesCommand command;
      const auto bytes = std::span(space).first(static_cast<std::size_t>(size));
      if (const auto fault = codec_.decode(bytes, command); fault != AxesFault::none) {
        refuse(fault, "a datagram", figures);
      } else if (hand_over(command, table, now_ns, figures)) {
        host_ = from;
      }
    }
  }
  void report(const AxesMonitor& monitor, std::int64_t /*now_ns*/,
              FmsSimFigures& figures) override {
    if (host_.length == 0) return;
    if (socket_.send_to(codec_.encode(monitor), host_).status != IoStatus::done) {
      ++figures.failed_sends;
    }
  }

 private:
  server::UdpSocket socket_;
  protocol::AxesCodec codec_;
  server::SocketAddress host_;  ///< sender of the latest command; length 0: none yet
};

class MemoryPort final : public FmsSimPort {
 public:
  MemoryPort(const config::MemoryPlace& place, server::AxesMemory memory)
      : place_(place),
        memory_(std::move(memory)),
        seen_(protocol::latest_counter(memory_.command())) {}
  [[nodiscard]] std::string name() const override {
    return fmt::format("axes_memory={}@{}", place_.file.string(), place_.offset_bytes);
  }
  void take(server::TableSimulator& table, std::int64_t now_ns, FmsSimFigures& figures) override {
    AxesCommand command;
    const protocol::AxesLoad load = protocol::load_axes(memory_.command(), seen_, command);
    switch (load.status) {
      case protocol::AxesLoadStatus::done:
        hand_over(command, table, now_ns, figures);
        break;
      case protocol::AxesLoadStatus::refused:
        refuse(load.fault, "what is in memory", figures);
        break;
      case protocol::AxesLoadStatus::torn:
        ++figures.torn;
        break;
      case protocol::AxesLoadStatus::nothing:
        break;
    }
  }
  void report(const AxesMonitor& monitor, std::int64_t /*now_ns*/,
              FmsSimFigures& /*figures*/) override {
    protocol::store_axes(memory_.monitor(), monitor);
  }

 private:
  config::MemoryPlace place_;
  server::AxesMemory memory_;
  std::uint64_t seen_;  ///< counter of the latest command
};

class AcutrolPort final : public FmsSimPort {
 public:
  AcutrolPort(server::TcpListener listener, std::size_t axes)
      : listener_(std::move(listener)), table_(axes) {}
  [[nodiscard]] std::string name() const override {
    return "axes_acutrol=" + server::to_string(listener_.local_address());
  }
  void take(server::TableSimulator& table, std::int64_t now_ns,
            FmsSimFigures& /*figures*/) override {
    static_cast<void>(table.take(table_.command(now_ns), now_ns));
  }
  void report(const AxesMonitor& monitor, std::int64_t now_ns, FmsSimFigures& figures) override {
    table_.update(monitor);
    accept();
    constexpr int kMostReads = 8;
    for (int i = 0; i < kMostReads && host_; ++i) {
      std::array<char, 4096> space;
      const IoResult got = host_.read_some(std::as_writable_bytes(std::span(space)));
      if (got.status == IoStatus::would_block) return;
      if (got.status != IoStatus::done) {
        host_.close();
        return;
      }
      answer({space.data(), got.bytes}, now_ns, figures);
    }
  }

 private:
  void accept() {
    server::SocketAddress peer;
    int error = 0;
    server::TcpSocket next = listener_.accept(peer, error);
    if (!next) return;
    host_ = std::move(next);
    splitter_.clear();
  }
  /// Answers all lines of some bytes by one piece.
  void answer(std::string_view bytes, std::int64_t now_ns, FmsSimFigures& figures) {
    answers_.clear();
    while (splitter_.next(bytes)) {
      answers_ += table_.answer(splitter_.line(), now_ns);
      ++figures.commands;
    }
    figures.malformed = table_.errors();
    if (answers_.empty()) return;
    const IoResult sent = host_.write_some(std::as_bytes(std::span(answers_)));
    if (sent.status == IoStatus::done && sent.bytes == answers_.size()) return;
    // The host does not read: the order of its answers is lost.
    ++figures.failed_sends;
    host_.close();
  }

  server::TcpListener listener_;
  server::TcpSocket host_;
  server::AcutrolTable table_;
  server::LineSplitter splitter_;
  std::string answers_;
};

}  // namespace

physics::Result<std::unique_ptr<FmsSimPort>> open_udp_port(const std::string& listen) {
  const auto address = address_of(listen, server::Transport::udp);
  if (!address) return tl::unexpected(address.error());
  const server::SocketContext context;
  auto socket = server::UdpSocket::open_bound(context, *address);
  if (!socket) return tl::unexpected(socket.error());
  return std::make_unique<UdpPort>(std::move(*socket));
}

physics::Result<std::unique_ptr<FmsSimPort>> open_memory_port(const config::MemoryPlace& place) {
  auto memory = server::AxesMemory::open_or_make(place);
  if (!memory) return tl::unexpected(memory.error());
  return std::make_unique<MemoryPort>(place, std::move(*memory));
}

physics::Result<std::unique_ptr<FmsSimPort>> open_acutrol_port(const std::string& listen,
                                                               std::size_t axes) {
  const auto address = address_of(listen, server::Transport::tcp);
  if (!address) return tl::unexpected(address.error());
  const server::SocketContext context;
  auto listener = server::TcpListener::open(context, *address);
  if (!listener) return tl::unexpected(listener.error());
  return std::make_unique<AcutrolPort>(std::move(*listener), axes);
}

}  // namespace emit::tool
