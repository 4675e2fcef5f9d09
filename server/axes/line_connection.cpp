// SPDX-License-Identifier: Apache-2.0
#include "axes/line_connection.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>

#include "emit/physics/check.hpp"

namespace emit::server {
namespace {

/// Time between two attempts, after which one that has not ended is given up.
constexpr std::int64_t kAttemptNs = 1'000'000'000;
/// Reads that empty a connection before it is closed.
constexpr int kMostLastReads = 16;

}  // namespace

LineConnection::State LineConnection::advance(std::int64_t now_ns) noexcept {
  if (state_ == State::connecting) look(now_ns);
  const std::int64_t since_ns = now_ns - began_ns_;
  // A clock that was set back does not keep the next attempt waiting.
  if (state_ == State::closed && (!began_once_ || since_ns >= kAttemptNs || since_ns < 0)) {
    begin(now_ns);
  }
  return state_;
}

void LineConnection::begin(std::int64_t now_ns) noexcept {
  began_once_ = true;
  began_ns_ = now_ns;
  fd_ = Fd(::socket(peer_.storage.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!fd_) return;
  // Each round of lines leaves at once.
  const int on = 1;
  ::setsockopt(fd_.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  if (::connect(fd_.get(), peer_.get(), peer_.length) == 0) {
    state_ = State::connected;
  } else if (errno == EINPROGRESS) {
    state_ = State::connecting;
  } else {
    fd_.reset();
  }
}

void LineConnection::look(std::int64_t now_ns) noexcept {
  pollfd waits{fd_.get(), POLLOUT, 0};
  int error = 0;
  socklen_t size = sizeof(error);
  if (::poll(&waits, 1, 0) == 1) {
    const bool done =
        ::getsockopt(fd_.get(), SOL_SOCKET, SO_ERROR, &error, &size) == 0 && error == 0;
    state_ = done ? State::connected : State::closed;
  } else if (now_ns - began_ns_ >= kAttemptNs || now_ns < began_ns_) {
    state_ = State::closed;
  }
  if (state_ == State::closed) fd_.reset();
}

IoResult LineConnection::read(std::span<char> space) noexcept {
  EMIT_DCHECK(state_ == State::connected);
  const ssize_t got = ::recv(fd_.get(), space.data(), space.size(), 0);
  if (got > 0) return {IoStatus::done, static_cast<std::size_t>(got), 0};
  if (got == 0) return {IoStatus::closed, 0, 0};
  const bool later = errno == EAGAIN || errno == EINTR;
  return {later ? IoStatus::would_block : IoStatus::failed, 0, later ? 0 : errno};
}

bool LineConnection::write(std::string_view text) noexcept {
  EMIT_DCHECK(state_ == State::connected);
  return ::send(fd_.get(), text.data(), text.size(), MSG_NOSIGNAL) ==
         static_cast<ssize_t>(text.size());
}

void LineConnection::close() noexcept {
  if (state_ == State::connected) {
    // Bytes that nobody read would make the kernel drop what is still to be sent.
    std::array<char, 1024> space;
    ::shutdown(fd_.get(), SHUT_WR);
    for (int i = 0; i<kMostLastReads&& ::recv(fd_.get(), space.data(), space.size(), 0)> 0; ++i) {
    }
  }
  fd_.reset();
  state_ = State::closed;
}

}  // namespace emit::server
