// SPDX-License-Identifier: Apache-2.0
#include "axes/udp_axes_link.hpp"

#include <array>
#include <cstddef>
#include <span>

namespace emit::server {
namespace {

/// Datagrams looked at per call, so that a flood of bad ones cannot hold the caller up.
constexpr int kMostPerCall = 32;

}  // namespace

physics::Result<std::unique_ptr<UdpAxesLink>> UdpAxesLink::open(const std::string& controller,
                                                                Counters& counters) {
  const auto where = parse_host_port(controller);
  if (!where) return tl::unexpected(where.error());
  const auto address = resolve(*where, Transport::udp, false);
  if (!address) return tl::unexpected(address.error());
  const SocketContext context;
  auto socket = UdpSocket::open(context, *address);
  if (!socket) return tl::unexpected(socket.error());
  if (auto connected = socket->connect(*address); !connected) {
    return tl::unexpected(connected.error());
  }
  return std::unique_ptr<UdpAxesLink>(new UdpAxesLink(std::move(*socket), counters));
}

std::optional<protocol::AxesMonitor> UdpAxesLink::receive(std::int64_t /*now_ns*/) noexcept {
  for (int i = 0; i < kMostPerCall; ++i) {
    std::array<std::byte, protocol::kMaxAxesBytes + 1> space;
    const IoResult got = socket_.receive(space);
    // The kernel reports here that nobody listened to an earlier command.
    if (got.status == IoStatus::failed) continue;
    if (got.status != IoStatus::done) return std::nullopt;
    protocol::AxesMonitor out;
    if (codec_.decode(std::span(space).first(got.bytes), out) == protocol::AxesFault::none) {
      return out;
    }
    counters_.add(Counter::axes_reports_refused);
  }
  return std::nullopt;
}

void UdpAxesLink::send(const protocol::AxesCommand& command, std::int64_t /*now_ns*/) noexcept {
  const IoResult sent = socket_.send(codec_.encode(command));
  counters_.add(sent.status == IoStatus::done ? Counter::axes_commands : Counter::axes_send_errors);
}

}  // namespace emit::server
