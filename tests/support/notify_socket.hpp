// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstring>
#include <string>

namespace emit::test {

/// A service manager's end of sd_notify(3).
class NotifySocket {
 public:
  /// Address of the socket: a path, or @name.
  explicit NotifySocket(const std::string& address)
      : fd_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un own{};
    own.sun_family = AF_UNIX;
    std::memcpy(own.sun_path, address.data(), address.size());
    if (address.front() == '@') own.sun_path[0] = '\0';
    bound_ = ::bind(fd_, reinterpret_cast<const sockaddr*>(&own),
                    static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address.size())) == 0;
  }
  ~NotifySocket() { ::close(fd_); }
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;

  [[nodiscard]] bool bound() const { return bound_; }
  /// Returns the next message; empty when none comes in time.
  [[nodiscard]] std::string next(int timeout_ms = 0) const {
    pollfd wait{fd_, POLLIN, 0};
    if (::poll(&wait, 1, timeout_ms) != 1) return {};
    std::array<char, 1024> text{};
    const ssize_t size = ::recv(fd_, text.data(), text.size(), 0);
    return size > 0 ? std::string(text.data(), static_cast<std::size_t>(size)) : std::string();
  }
  /// Returns all messages until one starts like that, one a line. The result is empty when it did
  /// not come.
  [[nodiscard]] std::string until(const std::string& start, int timeout_ms) const {
    std::string all;
    for (;;) {
      const std::string message = next(timeout_ms);
      if (message.empty()) return {};
      all += message + "\n";
      if (message.starts_with(start)) return all;
    }
  }

 private:
  int fd_ = -1;
  bool bound_ = false;
};

}  // namespace emit::test
