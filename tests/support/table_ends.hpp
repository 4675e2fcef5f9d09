// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "axes/acutrol_answer.hpp"
#include "axes/acutrol_table.hpp"
#include "axes/axes_memory.hpp"
#include "motion/table_simulator.hpp"
#include "net/socket.hpp"
#include "support/daemon_process.hpp"

namespace emit::test {

/// A simulated controller's end of a link. It exists before the agent that connects to it.
class TableEnd {
 public:
  virtual ~TableEnd() = default;
  /// Returns what motion.controller has to be.
  [[nodiscard]] virtual std::string controller() const = 0;
  /// Hands commands that have arrived to the table.
  virtual void take(server::TableSimulator& table, std::int64_t now_ns) = 0;
  /// Tells the host what the axes do.
  virtual void report(const protocol::AxesMonitor& monitor, std::int64_t now_ns) = 0;
  /// Mode of the latest command.
  protocol::AxesMode last_mode = protocol::AxesMode::off;
};

/// Messages by UDP.
class UdpTableEnd final : public TableEnd {
 public:
  UdpTableEnd() {
    const auto where = server::parse_host_port("127.0.0.1:0");
    auto socket = server::UdpSocket::open_bound(
        context_, *server::resolve(*where, server::Transport::udp, true));
    EXPECT_TRUE(socket.has_value());
    socket_ = std::move(*socket);
  }
  [[nodiscard]] std::string controller() const override {
    return fmt::format("127.0.0.1:{}", socket_.local_address().port());
  }
  void take(server::TableSimulator& table, std::int64_t now_ns) override {
    for (;;) {
      std::array<std::byte, protocol::kMaxAxesBytes> space;
      server::SocketAddress from;
      from.length = sizeof(from.storage);
      const ssize_t size = ::recvfrom(socket_.fd(), space.data(), space.size(), MSG_DONTWAIT,
                                      from.get(), &from.length);
      if (size < 0) return;
      host_ = from;
      protocol::AxesCommand command;
      EXPECT_EQ(codec_.decode(std::span(space).first(static_cast<std::size_t>(size)), command),
                protocol::AxesFault::none);
      EXPECT_TRUE(table.take(command, now_ns));
      last_mode = command.mode;
    }
  }
  void report(const protocol::AxesMonitor& monitor, std::int64_t /*now_ns*/) override {
    if (host_.length == 0) return;
    EXPECT_EQ(socket_.send_to(codec_.encode(monitor), host_).status, server::IoStatus::done);
  }

 private:
  const server::SocketContext context_;
  server::UdpSocket socket_;
  protocol::AxesCodec codec_;
  server::SocketAddress host_;
};

/// Blocks of memory in a file.
class MemoryTableEnd final : public TableEnd {
 public:
  MemoryTableEnd() {
    auto memory = server::AxesMemory::open_or_make({folder_.file("axes"), 64});
    EXPECT_TRUE(memory.has_value());
    memory_ = std::make_unique<server::AxesMemory>(std::move(*memory));
  }
  [[nodiscard]] std::string controller() const override {
    return "memory:" + folder_.file("axes") + "@64";
  }
  void take(server::TableSimulator& table, std::int64_t now_ns) override {
    protocol::AxesCommand command;
    const auto load = protocol::load_axes(memory_->command(), seen_, command);
    if (load.status == protocol::AxesLoadStatus::nothing) return;
    EXPECT_EQ(load.status, protocol::AxesLoadStatus::done);
    EXPECT_TRUE(table.take(command, now_ns));
    last_mode = command.mode;
  }
  void report(const protocol::AxesMonitor& monitor, std::int64_t /*now_ns*/) override {
    protocol::store_axes(memory_->monitor(), monitor);
  }

 private:
  const ScratchFolder folder_;
  std::unique_ptr<server::AxesMemory> memory_;
  std::uint64_t seen_ = 0;
};

/// ACUTROL command language over TCP, for five axes. The latest mode is follow or off.
class AcutrolTableEnd final : public TableEnd {
 public:
  AcutrolTableEnd() {
    const auto where = server::parse_host_port("127.0.0.1:0");
    auto listener =
        server::TcpListener::open(context_, *server::resolve(*where, server::Transport::tcp, true));
    EXPECT_TRUE(listener.has_value());
    listener_ = std::move(*listener);
  }
  [[nodiscard]] std::string controller() const override {
    return fmt::format("acutrol:127.0.0.1:{}", listener_.local_address().port());
  }
  void take(server::TableSimulator& table, std::int64_t now_ns) override {
    const protocol::AxesCommand& command = table_.command(now_ns);
    EXPECT_TRUE(table.take(command, now_ns));
    last_mode = command.mode;
  }
  void report(const protocol::AxesMonitor& monitor, std::int64_t now_ns) override {
    table_.update(monitor);
    server::SocketAddress peer;
    int error = 0;
    if (auto next = listener_.accept(peer, error)) {
      host_ = std::move(next);
      splitter_.clear();
    }
    std::array<char, 4096> space;
    while (host_) {
      const server::IoResult got = host_.read_some(std::as_writable_bytes(std::span(space)));
      if (got.status == server::IoStatus::closed) host_.close();
      if (got.status != server::IoStatus::done) return;
      std::string_view bytes(space.data(), got.bytes);
      std::string answers;
      while (splitter_.next(bytes)) answers += table_.answer(splitter_.line(), now_ns);
      static_cast<void>(host_.write_some(std::as_bytes(std::span(answers))));
    }
  }

 private:
  const server::SocketContext context_;
  server::TcpListener listener_;
  server::TcpSocket host_;
  server::LineSplitter splitter_;
  server::AcutrolTable table_{5};
};

}  // namespace emit::test
