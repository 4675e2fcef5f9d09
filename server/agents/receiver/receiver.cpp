// SPDX-License-Identifier: Apache-2.0
#include "agents/receiver/receiver.hpp"

#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <exception>
#include <new>

#include "agents/receiver/receiver_connection.hpp"
#include "net/ip_address.hpp"
#include "rt/error_text.hpp"

namespace emit::server {
namespace {

constexpr std::uint64_t kListenerKey = ~std::uint64_t{0};
constexpr std::uint64_t kUdpKey = ~std::uint64_t{0} - 1;
constexpr std::int64_t kHelloTimeoutNs = 5'000'000'000;
/// Before the listener is asked again.
constexpr std::int64_t kAcceptPauseNs = 100'000'000;
/// What a peer may leave unread of our answers.
constexpr std::size_t kMaxQueuedBytes = 256u << 10;
constexpr std::uint32_t kMaxMisbehaved = 1000;

}  // namespace

Receiver::Receiver(Context& context, const config::DaemonConfig& config)
    : Agent(context.bells.receiver),
      context_(context),
      config_(config),
      epoll_(::epoll_create1(EPOLL_CLOEXEC)),
      udp_memory_(std::make_unique<UdpMemory>()),
      limits_(config.access) {}

Receiver::~Receiver() = default;

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
  if (auto secured = open_security(); !secured) {
    return secured;
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
    auto udp = UdpSocket::open_bound(sockets_, *udp_address);
    if (!udp) {
      return tl::unexpected<physics::Error>(std::move(udp.error()).with_context("host.udp"));
    }
    udp_ = std::move(*udp);
    udp_.set_option(SOL_SOCKET, SO_TIMESTAMPNS, 1);
    udp_.set_option(SOL_SOCKET, SO_RXQ_OVFL, 1);
    constexpr std::uint64_t kHostBufferBytes = 4u << 20;
    udp_.set_receive_buffer(kHostBufferBytes);
  }

  const std::uint32_t places = std::clamp(config_.control.max_clients, 1U, kMaxConnections);
  for (std::uint32_t i = 0; i < places; ++i) {
    connections_.push_back(std::make_unique<Connection>());
    connections_.back()->index = i;
    connections_.back()->out.reserve(4096);
  }
  return {};
}

SocketAddress Receiver::control_address() const noexcept {
  return listener_.local_address();
}

SocketAddress Receiver::host_address() const noexcept {
  return udp_.local_address();
}

bool Receiver::on_start() noexcept {
  if (!epoll_ || !watch_listener()) {
    return false;
  }
  if (udp_) {
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.u64 = kUdpKey;
    udp_watched_ = ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, udp_.fd(), &event) == 0;
    return udp_watched_;
  }
  return true;
}

bool Receiver::watch_listener() noexcept {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u64 = kListenerKey;
  return ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, listener_.fd(), &event) == 0;
}

void Receiver::on_stop() noexcept {
  for (auto& connection : connections_) {
    if (connection->open()) {
      // Sender and recorder have ended before; nothing is lent any more.
      if (!connection->write_lent) {
        flush(*connection);
      }
      if (connection->open()) {  // unless the flush has ended it
        finish_close(*connection);
      }
    }
  }
}

int Receiver::do_work(std::int64_t now_ns) noexcept {
  wake_at_ns_ = kNeverNs;
  int work = 0;
  // Connections come and go with allocations; without memory for one, it is the one that ends.
  try {
    work += take_released();
    work += take_replies();
    resume_accepting(now_ns);
    std::array<epoll_event, 32> events{};
    const int count = ::epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()), 0);
    for (int i = 0; i < count; ++i) {
      const epoll_event& event = events[static_cast<std::size_t>(i)];
      if (event.data.u64 == kListenerKey) {
        work += accept_connections(now_ns);
      } else if (event.data.u64 == kUdpKey) {
        work += receive_datagrams(now_ns);
      } else {
        Connection& connection = *connections_[connection_place(event.data.u64)];
        if (!connection.open() || connection.key() != event.data.u64) {
          continue;
        }
        if ((event.events & EPOLLOUT) != 0) {
          if (connection.handshaking) {
            work += handshake(connection, now_ns);
          } else {
            flush(connection);
            ++work;
          }
        }
        if (!connection.open()) continue;
        if (connection.waits()) {
          // It hangs up for as long as it is looked at, however much of it is unread.
          if ((event.events & (EPOLLHUP | EPOLLERR)) != 0) {
            close(connection, "reset by the peer");
            ++work;
          }
        } else if ((event.events & (EPOLLIN | EPOLLHUP | EPOLLERR)) != 0) {
          work += read(connection, now_ns);
        }
      }
    }
    for (auto& connection : connections_) {
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
    if (udp_ && !udp_watched_ && !draining_.load(std::memory_order_acquire)) {
      work += receive_datagrams(now_ns);
    }
    check_timeouts(now_ns);
    for (auto& connection : connections_) {
      if (connection->open() && connection->dirty) {
        watch(*connection);
      }
    }
  } catch (const std::exception& error) {
    context_.receiver_events.push(EventKind::refused,
                                  static_cast<std::uint64_t>(StatusCode::internal),
                                  context_.counters.add(Counter::refused_internal), error.what());
  }
  return work;
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
    static_cast<void>(admit(std::move(socket), peer));
  }
  return work;
}

/// Out of descriptors or memory: whoever knocks waits in the kernel, and the listener, which stays
/// readable, must not keep this agent turning.
void Receiver::pause_accepting(std::int64_t now_ns, int error) noexcept {
  ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, listener_.fd(), nullptr);
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

int Receiver::read(Connection& connection, std::int64_t now_ns) {
  if (connection.handshaking) {
    return handshake(connection, now_ns);
  }
  if (connection.closing || connection.flush_close) {
    // Only the end of the stream is of interest; anything else is thrown away.
    std::array<std::byte, 4096> trash;
    const IoResult got = connection.socket.read_some(trash);
    if (got.status == IoStatus::closed || got.status == IoStatus::failed) {
      close(connection, "closed by the peer");
    }
    return 1;
  }
  std::span<std::byte> space = connection.parser->writable();
  if (space.empty()) {
    close(connection, "no room for a record");
    return 1;
  }
  // A little of each in turn: who sends as fast as it can must not keep a host's pose waiting.
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
      close(connection, connection.parser->pending_bytes() != 0 ? "closed in the middle of a record"
                                                                : "closed by the peer");
      break;
    case IoStatus::failed:
      close(connection, error_text(got.error));
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
    if (connection.role == Role::host && !draining_.load(std::memory_order_acquire) &&
        room_for_inputs() == 0) {
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
      take_record(connection, record, now_ns);
      continue;
    }
    const auto code = status == protocol::ParseStatus::oversize        ? StatusCode::oversize
                      : status == protocol::ParseStatus::wrong_version ? StatusCode::wrong_version
                                                                       : StatusCode::malformed;
    // The framing is lost: the connection ends after the answer.
    refuse(connection, code, std::string("record: ") + std::string(protocol::to_string(status)));
    connection.flush_close = true;
    flush(connection);
  }
  return work;
}

int Receiver::take_replies() {
  int work = 0;
  while (const StatusReply* reply = context_.replies.front()) {
    ++work;
    if (reply->origin.kind == Origin::Kind::udp) {
      send_udp_status(reply->origin, reply->code, reply->host_frame_number, reply->count,
                      status_text(reply->code, reply->detail));
    } else if (reply->origin.kind == Origin::Kind::tcp) {
      Connection& connection = *connections_[reply->origin.connection];
      if (connection.open() && !connection.closing &&
          connection.generation == reply->origin.generation) {
        send_status(connection, reply->code, status_text(reply->code, reply->detail),
                    reply->host_frame_number, reply->count);
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
  for (auto& connection : connections_) {
    if (!connection->open() || connection->closing) {
      continue;
    }
    if (connection->misbehaved > kMaxMisbehaved) {
      close(*connection, "too many refused messages");
      continue;
    }
    if (connection->out.size() - connection->out_sent > kMaxQueuedBytes) {
      close(*connection, "does not read its answers");
      continue;
    }
    if (connection->paused) {
      const std::int64_t wait_ns = connection->pace.wait_ns(context_.clock.monotonic_ns());
      wake_at_ns_ = std::min(wake_at_ns_, now_ns + std::max<std::int64_t>(wait_ns, 0));
    }
    if (!connection->welcomed || connection->flush_close) {
      const std::int64_t left_ns =
          connection->since_ns + kHelloTimeoutNs - context_.clock.monotonic_ns();
      if (left_ns <= 0) {
        if (connection->handshaking) {
          context_.counters.add(Counter::handshakes_failed);
        }
        close(*connection, connection->handshaking ? "TLS handshake not done within 5 s"
                                                   : "no hello within 5 s");
      } else {
        wake_at_ns_ = std::min(wake_at_ns_, now_ns + left_ns);
      }
    }
  }
}

}  // namespace emit::server
