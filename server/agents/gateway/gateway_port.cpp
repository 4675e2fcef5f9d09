// SPDX-License-Identifier: Apache-2.0
#include "agents/gateway/gateway_port.hpp"

#include <utility>

#include "net/ip_address.hpp"

namespace emit::server {
namespace {

/// Datagrams looked at per call, so that a flood of foreign ones cannot hold the caller up.
constexpr int kMostPerCall = 32;
constexpr std::uint64_t kReceiveBufferBytes = 4u << 20;

}  // namespace

GatewayPort::GatewayPort(UdpSocket socket, const SocketAddress& host, const Clock& clock,
                         Counters& counters)
    : socket_(std::move(socket)),
      host_(host),
      host_ip_(ip_of(host)),
      clock_(&clock),
      counters_(&counters),
      space_(std::make_unique<std::array<std::byte, kDatagramBytes>>()) {}

physics::Result<GatewayPort> GatewayPort::open(const std::string& section,
                                               const std::string& listen, const std::string& host,
                                               const Clock& clock, Counters& counters) {
  const auto named = [&](const physics::Error& error, const char* key) {
    return tl::unexpected<physics::Error>(physics::Error(error).with_context(section + "." + key));
  };
  const auto here = parse_host_port(listen);
  if (!here) return named(here.error(), "listen");
  const auto address = resolve(*here, Transport::udp, true);
  if (!address) return named(address.error(), "listen");
  const auto there = parse_host_port(host);
  if (!there) return named(there.error(), "host");
  const auto peer = resolve(*there, Transport::udp, false);
  if (!peer) return named(peer.error(), "host");
  const SocketContext context;
  auto socket = UdpSocket::open_bound(context, *address);
  if (!socket) return named(socket.error(), "listen");
  StampedReceiver::prepare(*socket);
  socket->set_receive_buffer(kReceiveBufferBytes);
  return GatewayPort(std::move(*socket), *peer, clock, counters);
}

std::optional<StampedDatagram> GatewayPort::receive() noexcept {
  for (int i = 0; i < kMostPerCall; ++i) {
    const auto datagram = receiver_.receive(socket_, *space_, *clock_);
    if (!datagram) return std::nullopt;
    counters_->add(Counter::gateway_datagrams);
    counters_->add(Counter::gateway_os_drops, datagram->os_drops);
    if (ip_of(datagram->from) == host_ip_) return datagram;
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
