// SPDX-License-Identifier: Apache-2.0
#include "axes/acutrol_axes_link.hpp"

#include <array>

namespace emit::server {
namespace {

/// An answer that has not come after so long does not come any more.
constexpr std::int64_t kSilenceNs = 1'000'000'000;
/// Reads per call, so that a flood cannot hold the caller up.
constexpr int kMostReads = 8;

}  // namespace

physics::Result<std::unique_ptr<AcutrolAxesLink>> AcutrolAxesLink::open(
    const std::string& controller, const std::vector<AcutrolHost::Axis>& axes, Counters& counters,
    EventLog& events) {
  const auto where = parse_host_port(controller);
  if (!where) return tl::unexpected(where.error());
  const auto address = resolve(*where, Transport::tcp, false);
  if (!address) return tl::unexpected(address.error());
  auto host = AcutrolHost::create(axes, counters, events);
  if (!host) return tl::unexpected(std::move(host.error()));
  return std::unique_ptr<AcutrolAxesLink>(
      new AcutrolAxesLink(to_string(*address), *address, std::move(*host), counters, events));
}

void AcutrolAxesLink::lose(std::string_view why) noexcept {
  connection_.close();
  counters_.add(Counter::axes_connections_lost);
  events_.push(EventKind::axes_lost, 0, 0, why);
}

bool AcutrolAxesLink::connected(std::int64_t now_ns) noexcept {
  if (connection_.state() == LineConnection::State::connected) return true;
  if (connection_.advance(now_ns) != LineConnection::State::connected) return false;
  host_.start();
  events_.push(EventKind::axes_connected, 0, 0, controller_);
  return true;
}

std::optional<protocol::AxesMonitor> AcutrolAxesLink::receive(std::int64_t now_ns) noexcept {
  for (int i = 0; i < kMostReads && connection_.state() == LineConnection::State::connected; ++i) {
    std::array<char, 1024> space;
    const IoResult got = connection_.read(space);
    if (got.status == IoStatus::would_block) break;
    if (got.status != IoStatus::done) {
      lose(got.status == IoStatus::closed ? "the controller closed the connection"
                                          : "the connection broke");
      break;
    }
    host_.take({space.data(), got.bytes}, now_ns);
    if (host_.order_lost()) lose("an answer of a wrong kind: answers are out of order");
  }
  return host_.monitor();
}

void AcutrolAxesLink::send(const protocol::AxesCommand& command, std::int64_t now_ns) noexcept {
  if (connection_.state() == LineConnection::State::connected &&
      host_.waits_since(now_ns - kSilenceNs)) {
    lose("no answer for a second");
  }
  if (!connected(now_ns)) {
    counters_.add(Counter::axes_send_errors);
    return;
  }
  const std::string_view lines = host_.lines(command, now_ns);
  if (lines.empty()) return;
  if (!connection_.write(lines)) {
    lose("the controller does not read");
    return;
  }
  counters_.add(Counter::axes_commands);
}

}  // namespace emit::server
