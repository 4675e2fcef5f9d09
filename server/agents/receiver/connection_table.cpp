// SPDX-License-Identifier: Apache-2.0
#include "agents/receiver/connection_table.hpp"

#include <sys/epoll.h>

#include <algorithm>

#include "emit/physics/check.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/v1/control.pb.h"
#include "net/tls_session.hpp"

namespace emit::server {

void Connection::begin() noexcept {
  generation = (generation + 1) & (~0U >> kConnectionPlaceBits);
  role = Role::none;
  welcomed = false;
  closing = false;
  flush_close = false;
  lent = false;
  write_lent = false;
  stuck = false;
  paused = false;
  dirty = false;
  reread = false;
  agreed_key = false;
  misbehaved = 0;
  out.clear();
  out_sent = 0;
}

ConnectionTable::ConnectionTable(Context& context)
    : context_(context), epoll_(::epoll_create1(EPOLL_CLOEXEC)) {}

void ConnectionTable::make_places(std::uint32_t count) {
  constexpr std::size_t kAnswerBytes = 4096;
  for (std::uint32_t i = 0; i < count; ++i) {
    connections_.push_back(std::make_unique<Connection>());
    connections_.back()->index = i;
    connections_.back()->out.reserve(kAnswerBytes);
  }
}

Connection* ConnectionTable::free_place() noexcept {
  const auto place = std::ranges::find_if(
      connections_, [](const auto& connection) { return !connection->open(); });
  return place != connections_.end() ? place->get() : nullptr;
}

Connection* ConnectionTable::find(std::uint64_t key) noexcept {
  EMIT_DCHECK_OP(connection_place(key), <, connections_.size());
  Connection& connection = *connections_[connection_place(key)];
  return connection.open() && connection.key() == key ? &connection : nullptr;
}

std::size_t ConnectionTable::open_from(const protocol::IpAddress& peer) const noexcept {
  return static_cast<std::size_t>(std::ranges::count_if(connections_, [&](const auto& connection) {
    return connection->open() && connection->ip == peer;
  }));
}

std::size_t ConnectionTable::handshakes() const noexcept {
  return static_cast<std::size_t>(std::ranges::count_if(connections_, [](const auto& connection) {
    return connection->open() && connection->handshaking;
  }));
}

void ConnectionTable::refuse(Connection& connection, StatusCode code, const std::string& text,
                             std::uint64_t host_frame_number, std::string_view event_text) {
  const std::uint64_t count = context_.counters.add(counter_of(code));
  ++connection.misbehaved;
  connection.pace.refusal(context_.clock.monotonic_ns());
  context_.receiver_events.push(EventKind::refused, static_cast<std::uint64_t>(code), count,
                                event_text.empty() ? text : event_text);
  send_status(connection, code, text, host_frame_number, count);
}

void ConnectionTable::refuse_and_close(Connection& connection, StatusCode code,
                                       const std::string& text) {
  refuse(connection, code, text);
  connection.flush_close = true;
  flush(connection);
}

void ConnectionTable::send_status(Connection& connection, StatusCode code, const std::string& text,
                                  std::uint64_t host_frame_number, std::uint64_t count) {
  if (connection.write_lent) {
    context_.counters.add(Counter::statuses_suppressed);
    return;
  }
  v1::ControlRecord answer;
  v1::Status& status = *answer.mutable_status();
  status.set_code(static_cast<v1::Status::Code>(code));
  status.set_text(text);
  status.set_host_frame_number(host_frame_number);
  status.set_count(count);
  queue(connection, answer);
  flush(connection);
}

void ConnectionTable::queue(Connection& connection, const v1::ControlRecord& record) {
  protocol::append_control_record(record, connection.out);
  connection.dirty = true;
}

void ConnectionTable::flush(Connection& connection) noexcept {
  // A refusal that could not be written may end the connection before the caller does.
  if (connection.write_lent || !connection.open()) {
    return;
  }
  while (connection.out_sent < connection.out.size()) {
    const IoResult sent = connection.socket.write_some(
        std::span<const std::byte>(connection.out).subspan(connection.out_sent));
    if (sent.status != IoStatus::done) {
      if (sent.status != IoStatus::would_block && sent.status != IoStatus::busy) {
        close(connection, "write failed");
      }
      connection.dirty = true;
      return;
    }
    connection.out_sent += sent.bytes;
  }
  if (!connection.out.empty()) {
    connection.out.clear();
    connection.out_sent = 0;
    connection.dirty = true;
  }
  if (connection.flush_close) {
    connection.socket.shutdown_send();
    close(connection, "refused");
  }
}

bool ConnectionTable::begin_watch(Connection& connection) noexcept {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u64 = connection.key();
  return ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, connection.socket.fd(), &event) == 0;
}

void ConnectionTable::watch(Connection& connection) noexcept {
  connection.dirty = false;
  epoll_event event{};
  const bool reading = !connection.waits() && !connection.closing;
  const bool writing = (connection.handshaking && connection.socket.tls()->wants_write()) ||
                       (!connection.write_lent && !connection.closing &&
                        connection.out_sent < connection.out.size());
  event.events = (reading ? std::uint32_t{EPOLLIN} : 0U) | (writing ? std::uint32_t{EPOLLOUT} : 0U);
  event.data.u64 = connection.key();
  if (connection.closing) {
    // The connection waits for sender or recorder. A hang-up must not wake this agent over and
    // over.
    ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, connection.socket.fd(), nullptr);
    return;
  }
  ::epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, connection.socket.fd(), &event);
}

void ConnectionTable::close(Connection& connection, std::string_view why) noexcept {
  if (connection.closing || connection.index >= connections_.size() ||
      connections_[connection.index].get() != &connection) {
    return;
  }
  connection.closing = true;
  context_.receiver_events.push(EventKind::disconnected, connection.key(), 0, why);
  if (!connection.lent) {
    finish_close(connection);
    return;
  }
  connection.dirty = true;
  if (connection.role == Connection::Role::recorder) {
    static_cast<void>(
        context_.to_recorder.push({ClientCommand::Kind::remove, connection.key(), -1, 0}));
    context_.bells.recorder.ring();
  } else {
    static_cast<void>(
        context_.to_sender.push({ClientCommand::Kind::remove, connection.key(), nullptr}));
    context_.bells.sender.ring();
  }
}

void ConnectionTable::finish_close(Connection& connection) noexcept {
  ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, connection.socket.fd(), nullptr);
  connection.socket.close();
  if (connection.agreed_key) {
    connection.agreed_key = false;
    sessions_->remove_key(connection.key());
  }
  if (ClientCounts* counts = context_.counts_of(connection.key())) {
    counts->end();
  }
  connection.client.reset();
  connection.parser.reset();
  connection.lent = false;
  connection.write_lent = false;
  context_.counters.add(Counter::connections_closed);
}

void ConnectionTable::released(std::uint32_t key) noexcept {
  Connection* const connection = find(key);
  if (connection == nullptr || !connection->lent) {
    return;
  }
  connection->lent = false;
  connection->write_lent = false;
  connection->client.reset();
  if (!connection->closing) {
    // Sender or recorder have ended the connection: it was too slow, or its socket failed.
    context_.receiver_events.push(EventKind::disconnected, key, 0, "cannot keep up or failed");
    connection->closing = true;
  }
  finish_close(*connection);
}

int ConnectionTable::take_released() noexcept {
  int work = 0;
  while (const ClientReleased* client = context_.from_sender.front()) {
    released(client->connection);
    context_.from_sender.pop();
    ++work;
  }
  while (const RecorderReleased* recorder = context_.from_recorder.front()) {
    released(recorder->connection);
    context_.from_recorder.pop();
    ++work;
  }
  return work;
}

}  // namespace emit::server
