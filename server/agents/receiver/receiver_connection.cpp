// SPDX-License-Identifier: Apache-2.0
#include "agents/receiver/receiver_connection.hpp"

#include <sys/epoll.h>

/// What is written to a connection and how it ends.
namespace emit::server {

void Receiver::flush(Connection& connection) noexcept {
  // A refusal that could not be written has ended the connection before its caller wants it ended.
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

void Receiver::watch(Connection& connection) noexcept {
  connection.dirty = false;
  epoll_event event{};
  const bool reading = !connection.waits() && !connection.closing;
  const bool writing = (connection.handshaking && connection.socket.tls()->wants_write()) ||
                       (!connection.write_lent && !connection.closing &&
                        connection.out_sent < connection.out.size());
  event.events = (reading ? std::uint32_t{EPOLLIN} : 0U) | (writing ? std::uint32_t{EPOLLOUT} : 0U);
  event.data.u64 = connection.key();
  if (connection.closing) {
    // Waits for sender or recorder; a hang-up must not wake this agent over and over.
    ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, connection.socket.fd(), nullptr);
    return;
  }
  ::epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, connection.socket.fd(), &event);
}

void Receiver::close(Connection& connection, std::string_view why) noexcept {
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
  if (connection.role == Role::recorder) {
    static_cast<void>(
        context_.to_recorder.push({ClientCommand::Kind::remove, connection.key(), -1, 0}));
    context_.bells.recorder.ring();
  } else {
    static_cast<void>(
        context_.to_sender.push({ClientCommand::Kind::remove, connection.key(), nullptr}));
    context_.bells.sender.ring();
  }
}

void Receiver::finish_close(Connection& connection) noexcept {
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

int Receiver::take_released() noexcept {
  int work = 0;
  const auto released = [&](std::uint32_t key) {
    ++work;
    Connection& connection = *connections_[connection_place(key)];
    if (!connection.open() || connection.key() != key || !connection.lent) {
      return;
    }
    connection.lent = false;
    connection.write_lent = false;
    connection.client.reset();
    if (!connection.closing) {
      // Ended by sender or recorder: too slow, or its socket failed.
      context_.receiver_events.push(EventKind::disconnected, key, 0, "cannot keep up or failed");
      connection.closing = true;
    }
    finish_close(connection);
  };
  while (const ClientReleased* client = context_.from_sender.front()) {
    released(client->connection);
    context_.from_sender.pop();
  }
  while (const RecorderReleased* recorder = context_.from_recorder.front()) {
    released(recorder->connection);
    context_.from_recorder.pop();
  }
  return work;
}

}  // namespace emit::server
