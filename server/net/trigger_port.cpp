// SPDX-License-Identifier: Apache-2.0
#include "net/trigger_port.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <sys/socket.h>

#include "net/ip_address.hpp"

namespace emit::server {
namespace {

using physics::ErrorCode;
using physics::make_error;

/// Datagrams looked at per call, so that a flood of bad ones cannot hold the caller up.
constexpr int kMaxPerCall = 32;

}  // namespace

physics::Result<std::unique_ptr<TriggerPort>> TriggerPort::open(
    const std::string& udp, const std::string& peer, std::span<const protocol::SessionKey> keys,
    const Clock& clock, Counters& counters) {
  const auto named = [](const physics::Error& error, const char* key) {
    return tl::unexpected<physics::Error>(physics::Error(error).with_context(key));
  };
  const auto where = parse_host_port(udp);
  if (!where) return named(where.error(), "trigger.udp");
  const auto address = resolve(*where, Transport::udp, true);
  if (!address) return named(address.error(), "trigger.udp");
  std::optional<protocol::IpAddress> from;
  if (!peer.empty()) {
    from = protocol::parse_ip(peer);
    if (!from) {
      return make_error(ErrorCode::config, fmt::format("trigger.peer: '{}' is no address", peer));
    }
  } else if (!ip_of(*address).is_loopback()) {
    return make_error(ErrorCode::config,
                      fmt::format("trigger.udp: {} is reachable from outside: say with "
                                  "trigger.peer whose triggers are taken",
                                  to_string(*address)));
  }
  std::optional<protocol::TriggerSeal> seal;
  if (!keys.empty()) {
    auto made = protocol::TriggerSeal::create(keys);
    if (!made) return named(made.error(), "trigger.udp");
    seal = std::move(*made);
  }
  const SocketContext context;
  auto socket = UdpSocket::open_bound(context, *address);
  if (!socket) return named(socket.error(), "trigger.udp");
  StampedReceiver::prepare(*socket);
  return std::unique_ptr<TriggerPort>(
      new TriggerPort(std::move(*socket), from, std::move(seal), clock, counters));
}

std::string_view TriggerPort::take_unauthenticated() noexcept {
  if (!unauthenticated_) return {};
  const bool written =
      ::inet_ntop(unauthenticated_->v4 ? AF_INET : AF_INET6, unauthenticated_->bytes.data(),
                  text_.data(), static_cast<socklen_t>(text_.size())) != nullptr;
  unauthenticated_.reset();
  return written ? std::string_view(text_.data()) : std::string_view("?");
}

bool TriggerPort::accept(std::span<const std::byte> datagram, const protocol::IpAddress& from,
                         ReceivedTrigger& out) noexcept {
  using Verdict = protocol::TriggerSeal::Verdict;
  if (peer_ && from != *peer_) {
    counters_.add(Counter::triggers_refused);
    return false;
  }
  const Verdict verdict =
      seal_ ? seal_->open(datagram, out.trigger)
      : protocol::decode_trigger(datagram, out.trigger) == protocol::TriggerFault::none
          ? Verdict::genuine
          : Verdict::malformed;
  switch (verdict) {
    case Verdict::genuine:
      break;
    case Verdict::bare:
    case Verdict::unknown_key:
    case Verdict::bad_mac:
      counters_.add(Counter::triggers_unauthenticated);
      unauthenticated_ = from;
      return false;
    case Verdict::malformed:
      counters_.add(Counter::triggers_refused);
      return false;
  }
  // Numbers protect within a run of this daemon; what was recorded in another one is too old.
  const std::int64_t edge_ns = out.trigger.edge_ns;
  if (seal_ && (edge_ns < out.received_ns - kMaxAgeNs || edge_ns > out.received_ns + kMaxAgeNs)) {
    counters_.add(Counter::triggers_stale);
    return false;
  }
  return true;
}

std::optional<ReceivedTrigger> TriggerPort::next() noexcept {
  for (int i = 0; i < kMaxPerCall; ++i) {
    std::array<std::byte, protocol::kSealedTriggerBytes + 1> space;
    const auto datagram = receiver_.receive(socket_, space, clock_);
    if (!datagram) return std::nullopt;
    ReceivedTrigger out;
    out.received_ns = datagram->received_ns;
    counters_.add(Counter::trigger_os_drops, datagram->os_drops);
    counters_.add(Counter::triggers);
    if (accept(datagram->bytes, ip_of(datagram->from), out)) return out;
  }
  return std::nullopt;
}

}  // namespace emit::server
