// SPDX-License-Identifier: Apache-2.0
#include "agents/gateway/gateway_port.hpp"

#include <fmt/format.h>

#include <utility>

#include "net/ip_address.hpp"
#include "rt/error_text.hpp"

namespace emit::server {
namespace {

using physics::ErrorCode;
using physics::make_error;

/// Datagrams looked at per call, so that a flood of foreign ones cannot hold the caller up.
constexpr int kMostPerCall = 32;
constexpr std::uint64_t kReceiveBufferBytes = 4u << 20;

}  // namespace

GatewayPort::GatewayPort(UdpSocket socket, const SocketAddress& host,
                         std::vector<protocol::Network> allow, const Clock& clock,
                         Counters& counters)
    : socket_(std::move(socket)),
      host_(host),
      allow_(std::move(allow)),
      clock_(&clock),
      counters_(&counters),
      space_(std::make_unique<std::array<std::byte, kDatagramBytes>>()) {}

physics::Result<GatewayPort> GatewayPort::open(const Options& options, const Clock& clock,
                                               Counters& counters) {
  const auto named = [&](const physics::Error& error, const char* key) {
    return tl::unexpected<physics::Error>(
        physics::Error(error).with_context(options.section + "." + key));
  };
  const auto here = parse_host_port(options.listen);
  if (!here) return named(here.error(), "listen");
  const auto address = resolve(*here, Transport::udp, true);
  if (!address) return named(address.error(), "listen");
  SocketAddress host;
  if (!options.host.empty()) {
    const auto there = parse_host_port(options.host);
    if (!there) return named(there.error(), "host");
    const auto peer = resolve(*there, Transport::udp, false);
    if (!peer) return named(peer.error(), "host");
    host = *peer;
  }
  const SocketContext context;
  auto socket = UdpSocket::open(context, *address);
  if (!socket) return named(socket.error(), "listen");
  if (!options.group.empty()) {
    const SocketAddress group = numeric_address(options.group, address->port());
    if (!group.is_multicast()) {
      return make_error(ErrorCode::config, fmt::format("{}.group: '{}' is no multicast group",
                                                       options.section, options.group));
    }
    socket->allow_shared_port();
    if (const int error = socket->join_group(group, interface_of(*address)); error != 0) {
      return make_error(ErrorCode::io, fmt::format("{}.group: {}: {}", options.section,
                                                   options.group, error_text(error)));
    }
  }
  if (auto bound = socket->bind(*address); !bound) return named(bound.error(), "listen");
  StampedReceiver::prepare(*socket);
  socket->set_receive_buffer(kReceiveBufferBytes);
  return GatewayPort(std::move(*socket), host, options.allow, clock, counters);
}

bool GatewayPort::admits(const protocol::IpAddress& peer) const noexcept {
  if (host_.length != 0) return peer == ip_of(host_);
  return allow_.empty() || peer.is_loopback() || protocol::any_contains(allow_, peer);
}

std::optional<StampedDatagram> GatewayPort::receive() noexcept {
  for (int i = 0; i < kMostPerCall; ++i) {
    const auto datagram = receiver_.receive(socket_, *space_, *clock_);
    if (!datagram) return std::nullopt;
    counters_->add(Counter::gateway_datagrams);
    counters_->add(Counter::gateway_os_drops, datagram->os_drops);
    if (admits(ip_of(datagram->from))) return datagram;
    counters_->add(Counter::gateway_peers_refused);
  }
  return std::nullopt;
}

void GatewayPort::send(std::span<const std::byte> message) noexcept {
  const IoResult sent = socket_.send_to(message, host_);
  counters_->add(sent.status == IoStatus::done ? Counter::gateway_messages_sent
                                               : Counter::gateway_send_errors);
}

}  // namespace emit::server
