// SPDX-License-Identifier: Apache-2.0
#include "io/trigger_port.hpp"

#include <fmt/format.h>
#include <sys/socket.h>

#include <cstring>
#include <ctime>

#include "io/ip_address.hpp"

namespace emit::server {
namespace {

using physics::ErrorCode;
using physics::make_error;

/// Datagrams looked at per call, so that a flood of bad ones cannot hold the caller up.
constexpr int kMaxPerCall = 32;

}  // namespace

physics::Result<std::unique_ptr<TriggerPort>> TriggerPort::open(const std::string& udp,
                                                                const std::string& peer,
                                                                const Clock& clock,
                                                                Counters& counters) {
  const auto named = [](const physics::Error& error, const char* key) {
    return tl::unexpected<physics::Error>(physics::Error(error).with_context(key));
  };
  const auto where = parse_host_port(udp);
  if (!where) return named(where.error(), "trigger.udp");
  const auto address = resolve(*where, Transport::udp, true);
  if (!address) return named(address.error(), "trigger.udp");
  std::optional<config::IpAddress> from;
  if (!peer.empty()) {
    from = config::parse_ip(peer);
    if (!from) {
      return make_error(ErrorCode::config, fmt::format("trigger.peer: '{}' is no address", peer));
    }
  } else if (!ip_of(*address).is_loopback()) {
    return make_error(ErrorCode::config,
                      fmt::format("trigger.udp: {} is reachable from outside: say with "
                                  "trigger.peer whose triggers are taken",
                                  to_string(*address)));
  }
  const SocketContext context;
  auto socket = UdpSocket::open_bound(context, *address);
  if (!socket) return named(socket.error(), "trigger.udp");
  socket->set_option(SOL_SOCKET, SO_TIMESTAMPNS, 1);
  socket->set_option(SOL_SOCKET, SO_RXQ_OVFL, 1);
  return std::unique_ptr<TriggerPort>(new TriggerPort(std::move(*socket), from, clock, counters));
}

std::optional<ReceivedTrigger> TriggerPort::next() noexcept {
  for (int i = 0; i < kMaxPerCall; ++i) {
    std::array<std::byte, protocol::kTriggerBytes + 1> bytes;
    alignas(cmsghdr) std::array<char, 128> control;
    sockaddr_storage from{};
    iovec piece{bytes.data(), bytes.size()};
    msghdr message{};
    message.msg_name = &from;
    message.msg_namelen = sizeof from;
    message.msg_iov = &piece;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    // Natively, for the arrival time.
    const ssize_t size = ::recvmsg(socket_.fd(), &message, MSG_DONTWAIT);
    if (size < 0) return std::nullopt;
    const std::int64_t now_ns = clock_.tai_ns();
    ReceivedTrigger out;
    out.received_ns = now_ns;
    for (cmsghdr* header = CMSG_FIRSTHDR(&message); header != nullptr;
         header = CMSG_NXTHDR(&message, header)) {
      if (header->cmsg_level != SOL_SOCKET) continue;
      if (header->cmsg_type == SCM_TIMESTAMPNS) {
        timespec stamp{};
        std::memcpy(&stamp, CMSG_DATA(header), sizeof stamp);
        out.received_ns = clock_.tai_from_kernel_stamp_ns(
            std::int64_t{stamp.tv_sec} * 1'000'000'000 + stamp.tv_nsec);
      } else if (header->cmsg_type == SO_RXQ_OVFL) {
        std::uint32_t drops = 0;
        std::memcpy(&drops, CMSG_DATA(header), sizeof drops);
        counters_.add(Counter::trigger_os_drops, drops - os_drops_seen_);
        os_drops_seen_ = drops;
      }
    }
    counters_.add(Counter::triggers);
    const bool wrong_sender = peer_ && ip_of(from) != *peer_;
    const std::span<const std::byte> datagram(bytes.data(), static_cast<std::size_t>(size));
    if (wrong_sender ||
        protocol::decode_trigger(datagram, out.trigger) != protocol::TriggerFault::none) {
      counters_.add(Counter::triggers_refused);
      continue;
    }
    return out;
  }
  return std::nullopt;
}

}  // namespace emit::server
