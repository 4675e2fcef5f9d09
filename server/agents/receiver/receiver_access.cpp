// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <sys/epoll.h>

#include <algorithm>
#include <cstring>

#include "agents/receiver/receiver_connection.hpp"
#include "net/ip_address.hpp"
#include "net/key_file.hpp"

/// Who may connect: addresses, certificates, keys.
namespace emit::server {

namespace {

/// Distinct warnings about datagrams that are dropped unread: not for every one of a flood.
constexpr std::int64_t kWarningGapNs = 100'000'000;

/// Empty: no TLS.
physics::Result<std::optional<TlsContext>> load_tls(const config::TlsConfig& tls) {
  if (!tls.enabled()) {
    return std::nullopt;
  }
  auto context = TlsContext::server({tls.client_ca, tls.certificate, tls.key});
  if (!context) {
    return tl::unexpected<physics::Error>(std::move(context.error()).with_context("tls"));
  }
  return std::optional(std::move(*context));
}

/// Empty: no file is named.
physics::Result<std::vector<protocol::SessionKey>> load_keys(const config::DaemonConfig& config) {
  if (config.host.key_file.empty()) {
    return std::vector<protocol::SessionKey>();
  }
  auto keys = read_key_file(config.host.key_file);
  if (!keys) {
    return tl::unexpected<physics::Error>(std::move(keys.error()).with_context("host.key_file"));
  }
  return keys;
}

}  // namespace

physics::Result<void> check_security(const config::DaemonConfig& config) {
  if (auto tls = load_tls(config.tls); !tls) {
    return tl::unexpected<physics::Error>(std::move(tls.error()));
  }
  if (auto keys = load_keys(config); !keys) {
    return tl::unexpected<physics::Error>(std::move(keys.error()));
  }
  return {};
}

physics::Result<void> Receiver::open_security() {
  auto tls = load_tls(config_.tls);
  if (!tls) {
    return tl::unexpected<physics::Error>(std::move(tls.error()));
  }
  tls_ = std::move(*tls);
  if (config_.host.udp.empty() || !config_.authenticated_host()) {
    return {};
  }
  auto keys = load_keys(config_);
  if (!keys) {
    return tl::unexpected<physics::Error>(std::move(keys.error()));
  }
  auto sessions = HostSessions::create(*keys, tls_ ? config_.control.max_clients : 0);
  if (!sessions) {
    return tl::unexpected<physics::Error>(std::move(sessions.error()).with_context("host.udp"));
  }
  sessions_ = std::move(*sessions);
  return {};
}

bool Receiver::may_connect(const protocol::IpAddress& peer) const noexcept {
  return config_.access.allow.empty() || peer.is_loopback() ||
         protocol::any_contains(config_.access.allow, peer);
}

void Receiver::turn_away(PeerRefusal why, Counter counter, const protocol::IpAddress& peer,
                         const std::string& detail) {
  context_.counters.add(counter);
  const std::int64_t now_ns = context_.clock.monotonic_ns();
  if (now_ns - warned_ns_ < kWarningGapNs) {
    return;
  }
  warned_ns_ = now_ns;
  context_.receiver_events.push(EventKind::peer_refused, static_cast<std::uint64_t>(why), 0,
                                to_string(peer) + (detail.empty() ? "" : ": " + detail));
}

std::size_t Receiver::connections_from(const protocol::IpAddress& peer) const noexcept {
  return static_cast<std::size_t>(std::count_if(
      connections_.begin(), connections_.end(),
      [&](const auto& connection) { return connection->open() && connection->ip == peer; }));
}

std::size_t Receiver::handshakes() const noexcept {
  return static_cast<std::size_t>(std::count_if(
      connections_.begin(), connections_.end(),
      [](const auto& connection) { return connection->open() && connection->handshaking; }));
}

bool Receiver::admit(TcpSocket socket, const SocketAddress& peer) {
  const protocol::IpAddress ip = ip_of(peer);
  if (!may_connect(ip)) {
    turn_away(PeerRefusal::not_allowed, Counter::peers_refused, ip);
    return false;
  }
  const auto place = std::find_if(connections_.begin(), connections_.end(),
                                  [](const auto& connection) { return !connection->open(); });
  const bool draining = draining_.load(std::memory_order_acquire);
  const bool crowded =
      !ip.is_loopback() && connections_from(ip) >= config_.access.max_connections_per_peer;
  if (place == connections_.end() || draining || crowded) {
    if (crowded) {
      context_.counters.add(Counter::peer_limit_refused);
    }
    if (tls_) {
      // Nothing can be said to somebody who is not known yet.
      context_.counters.add(Counter::refused_overloaded);
      return false;
    }
    // One connection more than allowed gets an answer of its own, without a place in the table.
    Connection guest;
    guest.socket = std::move(socket);
    refuse(guest, StatusCode::overloaded,
           draining  ? "the daemon is stopping"
           : crowded ? "as many connections as access.max_connections_per_peer allows"
                     : "as many connections as control.max_clients allows");
    guest.socket.shutdown_send();
    return false;
  }
  if (tls_ && handshakes() >= config_.tls.max_handshakes) {
    context_.counters.add(Counter::handshakes_refused);
    return false;
  }
  Connection& connection = **place;
  // First what may throw, so that a place is never half taken.
  protocol::RecordLimits limits;
  limits.max_control_bytes = config_.control.max_record_bytes;
  connection.parser.emplace(limits);
  if (tls_) {
    if (auto started = socket.start_tls(*tls_, {}); !started) {
      turn_away(PeerRefusal::handshake, Counter::handshakes_failed, ip, started.error().text);
      return false;
    }
  }
  connection.socket = std::move(socket);
  connection.peer = peer;
  connection.ip = ip;
  connection.generation = (connection.generation + 1) & (~0U >> kConnectionPlaceBits);
  connection.role = Role::none;
  connection.welcomed = false;
  connection.closing = false;
  connection.flush_close = false;
  connection.lent = false;
  connection.write_lent = false;
  connection.stuck = false;
  connection.paused = false;
  connection.dirty = false;
  connection.handshaking = tls_.has_value();
  connection.reread = false;
  connection.agreed_key = false;
  connection.misbehaved = 0;
  connection.pace =
      ReadPace(config_.access.max_host_frames_hz + config_.access.max_control_records_hz);
  connection.since_ns = context_.clock.monotonic_ns();
  connection.out.clear();
  connection.out_sent = 0;
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u64 = connection.key();
  if (::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, connection.socket.fd(), &event) != 0) {
    connection.socket.close();
    return false;
  }
  if (ClientCounts* counts = context_.counts_of(connection.key())) {
    counts->begin(connection.key());
  }
  context_.counters.add(Counter::connections_accepted);
  context_.receiver_events.push(EventKind::connected, connection.key(), 0, to_string(peer));
  return true;
}

int Receiver::handshake(Connection& connection, std::int64_t now_ns) {
  TlsSession& tls = *connection.socket.tls();
  const IoResult result = tls.handshake();
  connection.dirty = true;
  if (result.status == IoStatus::would_block || result.status == IoStatus::busy) {
    return 1;
  }
  if (result.status != IoStatus::done) {
    turn_away(PeerRefusal::handshake, Counter::handshakes_failed, connection.ip, tls.error());
    close(connection, "TLS handshake failed");
    return 1;
  }
  const std::vector<std::string> names = tls.peer_names();
  const std::vector<std::string>& allowed = config_.tls.allow_names;
  const auto is_allowed = [&](const std::string& name) {
    return std::find(allowed.begin(), allowed.end(), name) != allowed.end();
  };
  const std::string listed = fmt::format("{}", fmt::join(names, ", "));
  if (!allowed.empty() && std::none_of(names.begin(), names.end(), is_allowed)) {
    turn_away(PeerRefusal::handshake, Counter::handshakes_failed, connection.ip,
              "not in tls.allow_names: " + listed);
    close(connection, "certificate not in tls.allow_names");
    return 1;
  }
  connection.handshaking = false;
  context_.counters.add(Counter::handshakes_done);
  context_.receiver_events.push(EventKind::secured, connection.key(), 0, listed);
  return 1 + read(connection, now_ns);
}

void Receiver::agree_on_key(Connection& connection) {
  protocol::SessionKey key;
  if (sessions_ && connection.role == Role::host && connection.socket.tls() != nullptr &&
      connection.socket.tls()->export_key(key)) {
    sessions_->add_key(connection.key(), key);
    connection.agreed_key = true;
  }
}

std::optional<std::span<const std::byte>> Receiver::authenticate(
    std::span<const std::byte> datagram, const protocol::IpAddress& peer, Origin& origin) {
  using Verdict = HostSessions::Verdict;
  const HostSessions::Taken taken = sessions_->take(datagram);
  switch (taken.verdict) {
    case Verdict::host_frame:
      if (taken.began) {
        context_.counters.add(Counter::host_sessions);
        context_.receiver_events.push(EventKind::host_session, 0, 0, to_string(peer));
      }
      origin.connection = taken.place;
      origin.generation = taken.generation;
      return taken.payload;
    case Verdict::open: {
      const SocketAddress target = address_of(origin);
      if (!limits_.take_control_record(peer, target.port(), context_.clock.monotonic_ns())) {
        context_.counters.add(Counter::control_over_rate);
      } else if (udp_.send_to(sessions_->challenge(taken.header), target).status !=
                 IoStatus::done) {
        context_.counters.add(Counter::statuses_suppressed);
      }
      return std::nullopt;
    }
    case Verdict::bare:
      turn_away(PeerRefusal::mac, Counter::host_unauthenticated, peer);
      return std::nullopt;
    case Verdict::unknown_key:
      turn_away(PeerRefusal::mac, Counter::host_unknown_key, peer);
      return std::nullopt;
    case Verdict::bad_mac:
      turn_away(PeerRefusal::mac, Counter::host_bad_mac, peer);
      return std::nullopt;
    case Verdict::replayed:
      context_.counters.add(Counter::host_replayed);
      return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace emit::server
