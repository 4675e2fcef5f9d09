// SPDX-License-Identifier: Apache-2.0
#include "agents/receiver/receiver.hpp"

#include <fmt/format.h>
#include <sys/epoll.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <exception>
#include <new>

#include "net/ip_address.hpp"
#include "net/tls_session.hpp"
#include "rt/error_text.hpp"

namespace emit::server {
namespace {

constexpr std::uint64_t kListenerKey = ~std::uint64_t{0};
constexpr std::uint64_t kUdpKey = ~std::uint64_t{0} - 1;
constexpr std::int64_t kHelloTimeoutNs = 5'000'000'000;
/// Time before the listener is tried again, when there was no memory or descriptor.
constexpr std::int64_t kAcceptPauseNs = 100'000'000;
/// Bytes of our answers that a peer may leave unread.
constexpr std::size_t kMaxQueuedBytes = 256u << 10;
constexpr std::uint32_t kMaxMisbehaved = 1000;

}  // namespace

Receiver::Receiver(Context& context, const config::DaemonConfig& config)
    : Agent(context.bells.receiver),
      context_(context),
      config_(config),
      admission_(context, config),
      connections_(context),
      host_port_(context, admission_),
      session_(context, config, admission_, connections_, sockets_) {}

physics::Result<SocketAddress> Receiver::listen_address(std::string_view key,
                                                        const std::string& endpoint,
                                                        Transport transport,
                                                        config::Port port) const {
  const auto named = [key](const physics::Error& error) {
    return tl::unexpected<physics::Error>(physics::Error(error).with_context(std::string(key)));
  };
  const auto where = parse_host_port(endpoint);
  if (!where) {
    return named(where.error());
  }
  const auto address = resolve(*where, transport, true);
  if (!address) {
    return named(address.error());
  }
  // The configuration was judged by its text; a name may stand for any address.
  if (!ip_of(*address).is_loopback() && !config::is_protected(config_, port)) {
    return named({physics::ErrorCode::config, to_string(*address) +
                                                  ": other hosts may reach it: that needs " +
                                                  std::string(config::protections_of(port))});
  }
  return *address;
}

physics::Result<void> Receiver::open() {
  if (auto opened = admission_.open(); !opened) {
    return opened;
  }
  const auto address =
      listen_address("control.tcp", config_.control.tcp, Transport::tcp, config::Port::control);
  if (!address) {
    return tl::unexpected<physics::Error>(physics::Error(address.error()));
  }
  auto listener = TcpListener::open(sockets_, *address);
  if (!listener) {
    return tl::unexpected<physics::Error>(std::move(listener.error()).with_context("control.tcp"));
  }
  listener_ = std::move(*listener);
  if (!config_.host.udp.empty()) {
    const auto udp_address =
        listen_address("host.udp", config_.host.udp, Transport::udp, config::Port::host);
    if (!udp_address) {
      return tl::unexpected<physics::Error>(physics::Error(udp_address.error()));
    }
    if (auto opened = host_port_.open(sockets_, *udp_address, config_); !opened) {
      return opened;
    }
    session_.set_host_sessions(host_port_.sessions());
    connections_.set_host_sessions(host_port_.sessions());
  }
  connections_.make_places(std::clamp(config_.control.max_clients, 1U, kMaxConnections));
  return {};
}

bool Receiver::on_start() noexcept {
  return connections_.epoll_fd() >= 0 && watch_listener() &&
         (!host_port_.is_open() || host_port_.watch(connections_.epoll_fd(), kUdpKey));
}

bool Receiver::watch_listener() noexcept {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u64 = kListenerKey;
  return ::epoll_ctl(connections_.epoll_fd(), EPOLL_CTL_ADD, listener_.fd(), &event) == 0;
}

void Receiver::on_stop() noexcept {
  for (auto& connection : connections_.all()) {
    if (connection->open()) {
      // Sender and recorder have ended before; nothing is lent any more.
      if (!connection->write_lent) {
        connections_.flush(*connection);
      }
      if (connection->open()) {  // unless the flush has ended it
        connections_.finish_close(*connection);
      }
    }
  }
}

int Receiver::do_work(std::int64_t now_ns) noexcept {
  wake_at_ns_ = kNeverNs;
  int work = 0;
  // Connections come and go with allocations. Without memory for one, it is the one that ends.
  try {
    if (!draining_ && drain_.load(std::memory_order_acquire)) {
      draining_ = true;
      session_.drain();
    }
    work += connections_.take_released();
    work += take_replies();
    resume_accepting(now_ns);
    work += take_events(now_ns);
    work += resume_connections(now_ns);
    if (host_port_.is_open() && !host_port_.watched() && !draining_) {
      work += receive_datagrams(now_ns);
    }
    check_timeouts(now_ns);
    for (auto& connection : connections_.all()) {
      if (connection->open() && connection->dirty) {
        connections_.watch(*connection);
      }
    }
  } catch (const std::exception& error) {
    context_.receiver_events.push(EventKind::refused,
                                  static_cast<std::uint64_t>(StatusCode::internal),
                                  context_.counters.add(Counter::refused_internal), error.what());
  }
  return work;
}

int Receiver::take_events(std::int64_t now_ns) {
  int work = 0;
  std::array<epoll_event, 32> events{};
  const int count =
      ::epoll_wait(connections_.epoll_fd(), events.data(), static_cast<int>(events.size()), 0);
  for (int i = 0; i < count; ++i) {
    const epoll_event& event = events[static_cast<std::size_t>(i)];
    if (event.data.u64 == kListenerKey) {
      work += accept_connections(now_ns);
    } else if (event.data.u64 == kUdpKey) {
      work += receive_datagrams(now_ns);
    } else {
      work += take_connection_event(event.data.u64, event.events, now_ns);
    }
  }
  return work;
}

int Receiver::take_connection_event(std::uint64_t key, std::uint32_t events, std::int64_t now_ns) {
  Connection* const found = connections_.find(key);
  if (found == nullptr) {
    return 0;
  }
  Connection& connection = *found;
  int work = 0;
  if ((events & EPOLLOUT) != 0) {
    if (connection.handshaking) {
      work += handshake(connection, now_ns);
    } else {
      connections_.flush(connection);
      ++work;
    }
  }
  if (!connection.open()) {
    return work;
  }
  if (connection.waits()) {
    // A peer that hung up wakes this agent for as long as the connection is open, however much of
    // it is unread.
    if ((events & (EPOLLHUP | EPOLLERR)) != 0) {
      connections_.close(connection, "reset by the peer");
      ++work;
    }
  } else if ((events & (EPOLLIN | EPOLLHUP | EPOLLERR)) != 0) {
    work += read(connection, now_ns);
  }
  return work;
}

int Receiver::resume_connections(std::int64_t now_ns) {
  int work = 0;
  for (auto& connection : connections_.all()) {
    if (connection->open() && connection->waits() && may_go_on(*connection)) {
      connection->stuck = connection->paused = false;
      connection->dirty = true;
      work += 1 + parse(*connection, now_ns);
      connection->reread = connection->open() && connection->socket.has_buffered();
    }
    if (connection->open() && connection->reread && !connection->waits()) {
      connection->reread = false;
      work += read(*connection, now_ns);
    }
  }
  return work;
}

int Receiver::receive_datagrams(std::int64_t now_ns) noexcept {
  return host_port_.receive(draining_ ? 0 : room_for_inputs(), now_ns);
}

int Receiver::accept_connections(std::int64_t now_ns) {
  int work = 0;
  constexpr int kMaxPerTurn = 8;
  for (; work < kMaxPerTurn; ++work) {
    SocketAddress peer;
    int error = 0;
    TcpSocket socket;
    try {
      socket = listener_.accept(peer, error);
    } catch (const std::bad_alloc&) {
      error = ENOMEM;
    }
    if (error != 0) {
      pause_accepting(now_ns, error);
    }
    if (!socket) {
      break;
    }
    admit(std::move(socket), peer);
  }
  return work;
}

/// Pauses the listener. Without descriptors or memory, new peers wait in the kernel. The listener
/// stays readable and must not wake this agent again and again.
void Receiver::pause_accepting(std::int64_t now_ns, int error) noexcept {
  ::epoll_ctl(connections_.epoll_fd(), EPOLL_CTL_DEL, listener_.fd(), nullptr);
  accept_again_ns_ = context_.clock.monotonic_ns() + kAcceptPauseNs;
  wake_at_ns_ = std::min(wake_at_ns_, now_ns + kAcceptPauseNs);
  context_.receiver_events.push(
      EventKind::refused, static_cast<std::uint64_t>(StatusCode::overloaded),
      context_.counters.add(Counter::refused_overloaded), std::strerror(error));
}

void Receiver::resume_accepting(std::int64_t now_ns) noexcept {
  if (accept_again_ns_ == 0) {
    return;
  }
  const std::int64_t wait_ns = accept_again_ns_ - context_.clock.monotonic_ns();
  if (wait_ns > 0 || !watch_listener()) {
    wake_at_ns_ = std::min(wake_at_ns_,
                           now_ns + std::clamp(wait_ns, std::int64_t{1'000'000}, kAcceptPauseNs));
    return;
  }
  accept_again_ns_ = 0;
}

void Receiver::admit(TcpSocket socket, const SocketAddress& peer) {
  const protocol::IpAddress ip = ip_of(peer);
  if (!admission_.may_connect(ip)) {
    admission_.turn_away(PeerRefusal::not_allowed, Counter::peers_refused, ip);
    return;
  }
  Connection* const place = connections_.free_place();
  const bool crowded =
      !ip.is_loopback() && connections_.open_from(ip) >= config_.access.max_connections_per_peer;
  if (place == nullptr || draining_ || crowded) {
    refuse_place(std::move(socket), crowded);
    return;
  }
  const TlsContext* const tls = admission_.tls();
  if (tls != nullptr && connections_.handshakes() >= config_.tls.max_handshakes) {
    context_.counters.add(Counter::handshakes_refused);
    return;
  }
  Connection& connection = *place;
  // Steps that may throw come first, so that a place is never half taken.
  protocol::RecordLimits limits;
  limits.max_control_bytes = config_.control.max_record_bytes;
  connection.parser.emplace(limits);
  if (tls != nullptr) {
    if (auto started = socket.start_tls(*tls, {}); !started) {
      admission_.turn_away(PeerRefusal::handshake, Counter::handshakes_failed, ip,
                           started.error().text);
      return;
    }
  }
  connection.begin();
  connection.socket = std::move(socket);
  connection.peer = peer;
  connection.ip = ip;
  connection.handshaking = tls != nullptr;
  connection.pace =
      ReadPace(config_.access.max_host_frames_hz + config_.access.max_control_records_hz);
  connection.since_ns = context_.clock.monotonic_ns();
  if (!connections_.begin_watch(connection)) {
    connection.socket.close();
    return;
  }
  if (ClientCounts* counts = context_.counts_of(connection.key())) {
    counts->begin(connection.key());
  }
  context_.counters.add(Counter::connections_accepted);
  context_.receiver_events.push(EventKind::connected, connection.key(), 0, to_string(peer));
}

void Receiver::refuse_place(TcpSocket socket, bool crowded) {
  if (crowded) {
    context_.counters.add(Counter::peer_limit_refused);
  }
  if (admission_.tls() != nullptr) {
    // A peer that has not proved itself gets no answer.
    context_.counters.add(Counter::refused_overloaded);
    return;
  }
  // One connection more than allowed gets an answer of its own, without a place in the table.
  Connection guest;
  guest.socket = std::move(socket);
  connections_.refuse(guest, StatusCode::overloaded,
                      draining_ ? "the daemon is stopping"
                      : crowded ? "as many connections as access.max_connections_per_peer allows"
                                : "as many connections as control.max_clients allows");
  guest.socket.shutdown_send();
}

int Receiver::handshake(Connection& connection, std::int64_t now_ns) {
  TlsSession& tls = *connection.socket.tls();
  const IoResult result = tls.handshake();
  connection.dirty = true;
  if (result.status == IoStatus::would_block || result.status == IoStatus::busy) {
    return 1;
  }
  if (result.status != IoStatus::done) {
    admission_.turn_away(PeerRefusal::handshake, Counter::handshakes_failed, connection.ip,
                         tls.error());
    connections_.close(connection, "TLS handshake failed");
    return 1;
  }
  const std::vector<std::string> names = tls.peer_names();
  const std::string listed = fmt::format("{}", fmt::join(names, ", "));
  if (!admission_.may_connect(names)) {
    admission_.turn_away(PeerRefusal::handshake, Counter::handshakes_failed, connection.ip,
                         "not in tls.allow_names: " + listed);
    connections_.close(connection, "certificate not in tls.allow_names");
    return 1;
  }
  connection.handshaking = false;
  context_.counters.add(Counter::handshakes_done);
  context_.receiver_events.push(EventKind::secured, connection.key(), 0, listed);
  return 1 + read(connection, now_ns);
}

int Receiver::read(Connection& connection, std::int64_t now_ns) {
  if (connection.handshaking) {
    return handshake(connection, now_ns);
  }
  if (connection.closing || connection.flush_close) {
    // Only the end of the stream is of interest; anything else is thrown away.
    std::array<std::byte, 4096> trash;
    const IoResult got = connection.socket.read_some(trash);
    if (got.status == IoStatus::closed || got.status == IoStatus::failed) {
      connections_.close(connection, "closed by the peer");
    }
    return 1;
  }
  std::span<std::byte> space = connection.parser->writable();
  if (space.empty()) {
    connections_.close(connection, "no room for a record");
    return 1;
  }
  // Read a little of each connection in turn: a peer that sends as fast as it can must not keep a
  // host's pose waiting.
  constexpr std::size_t kTurnBytes = 16u << 10;
  space = space.first(std::min(space.size(), kTurnBytes));
  const IoResult got = connection.socket.read_some(space);
  switch (got.status) {
    case IoStatus::done: {
      connection.parser->commit(got.bytes);
      connection.pace.bytes(got.bytes, context_.clock.monotonic_ns());
      const int work = 1 + parse(connection, now_ns);
      connection.reread = connection.open() && connection.socket.has_buffered();
      return work;
    }
    case IoStatus::busy:
      connection.reread = true;
      break;
    case IoStatus::closed:
      connections_.close(connection, connection.parser->pending_bytes() != 0
                                         ? "closed in the middle of a record"
                                         : "closed by the peer");
      break;
    case IoStatus::failed:
      connections_.close(connection, error_text(got.error));
      break;
    case IoStatus::would_block:
      break;
  }
  return 1;
}

bool Receiver::may_go_on(const Connection& connection) noexcept {
  return (!connection.stuck || room_for_inputs() > 0) &&
         (!connection.paused || connection.pace.wait_ns(context_.clock.monotonic_ns()) <= 0);
}

int Receiver::parse(Connection& connection, std::int64_t now_ns) {
  const std::int64_t monotonic_ns = context_.clock.monotonic_ns();
  int work = 0;
  while (connection.open() && !connection.closing && !connection.flush_close) {
    if (connection.pace.in_debt(monotonic_ns)) {
      connection.paused = true;
      connection.dirty = true;
      context_.counters.add(Counter::reads_paused);
      break;
    }
    if (connection.role == protocol::PeerRole::host && !draining_ && room_for_inputs() == 0) {
      connection.stuck = true;
      connection.dirty = true;
      break;
    }
    protocol::Record record;
    const protocol::ParseStatus status = connection.parser->next(record);
    if (status == protocol::ParseStatus::need_more) {
      break;
    }
    ++work;
    connection.pace.record(monotonic_ns);
    if (status == protocol::ParseStatus::record) {
      session_.take(connection, record, now_ns);
    } else {
      refuse_framing(connection, status);
    }
  }
  return work;
}

void Receiver::refuse_framing(Connection& connection, protocol::ParseStatus status) {
  const auto code = status == protocol::ParseStatus::oversize        ? StatusCode::oversize
                    : status == protocol::ParseStatus::wrong_version ? StatusCode::wrong_version
                                                                     : StatusCode::malformed;
  connections_.refuse_and_close(connection, code,
                                std::string("record: ") + std::string(protocol::to_string(status)));
}

int Receiver::take_replies() {
  int work = 0;
  while (const StatusReply* reply = context_.replies.front()) {
    ++work;
    const std::string text = status_text(reply->code, reply->detail);
    if (reply->origin.kind == Origin::Kind::udp) {
      host_port_.send_status(reply->origin, reply->code, reply->host_frame_number, reply->count,
                             text);
    } else if (reply->origin.kind == Origin::Kind::tcp) {
      Connection& connection = *connections_.all()[reply->origin.connection];
      if (connection.open() && !connection.closing &&
          connection.generation == reply->origin.generation) {
        connections_.send_status(connection, reply->code, text, reply->host_frame_number,
                                 reply->count);
      }
    }
    context_.replies.pop();
  }
  return work;
}

std::size_t Receiver::room_for_inputs() noexcept {
  return context_.of_inputs
      .look([this] {
        const std::size_t room = context_.host_inputs.free();
        return room > 0 ? std::optional(room) : std::nullopt;
      })
      .value_or(0);
}

void Receiver::check_timeouts(std::int64_t now_ns) noexcept {
  for (auto& connection : connections_.all()) {
    if (connection->open() && !connection->closing) {
      check_timeout(*connection, now_ns);
    }
  }
}

void Receiver::check_timeout(Connection& connection, std::int64_t now_ns) noexcept {
  if (connection.misbehaved > kMaxMisbehaved) {
    connections_.close(connection, "too many refused messages");
    return;
  }
  if (connection.out.size() - connection.out_sent > kMaxQueuedBytes) {
    connections_.close(connection, "does not read its answers");
    return;
  }
  if (connection.paused) {
    const std::int64_t wait_ns = connection.pace.wait_ns(context_.clock.monotonic_ns());
    wake_at_ns_ = std::min(wake_at_ns_, now_ns + std::max<std::int64_t>(wait_ns, 0));
  }
  if (connection.welcomed && !connection.flush_close) {
    return;
  }
  const std::int64_t left_ns =
      connection.since_ns + kHelloTimeoutNs - context_.clock.monotonic_ns();
  if (left_ns > 0) {
    wake_at_ns_ = std::min(wake_at_ns_, now_ns + left_ns);
    return;
  }
  if (connection.handshaking) {
    context_.counters.add(Counter::handshakes_failed);
  }
  connections_.close(connection, connection.handshaking ? "TLS handshake not done within 5 s"
                                                        : "no hello within 5 s");
}

}  // namespace emit::server
