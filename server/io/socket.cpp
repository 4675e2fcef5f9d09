// SPDX-License-Identifier: Apache-2.0
#include "io/socket.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <climits>
#include <cstring>
#include <system_error>

namespace emit::server {

using physics::ErrorCode;
using physics::make_error;

std::uint16_t SocketAddress::port() const noexcept {
  if (storage.ss_family == AF_INET6) {
    sockaddr_in6 v6{};
    std::memcpy(&v6, &storage, sizeof(v6));
    return ntohs(v6.sin6_port);
  }
  sockaddr_in v4{};
  std::memcpy(&v4, &storage, sizeof(v4));
  return ntohs(v4.sin_port);
}

void SocketAddress::set_port(std::uint16_t port) noexcept {
  if (storage.ss_family == AF_INET6) {
    sockaddr_in6 v6{};
    std::memcpy(&v6, &storage, sizeof(v6));
    v6.sin6_port = htons(port);
    std::memcpy(&storage, &v6, sizeof(v6));
    return;
  }
  sockaddr_in v4{};
  std::memcpy(&v4, &storage, sizeof(v4));
  v4.sin_port = htons(port);
  std::memcpy(&storage, &v4, sizeof(v4));
}

physics::Result<HostPort> parse_host_port(std::string_view text) {
  const auto bad = [&] {
    return make_error(
        ErrorCode::config,
        fmt::format("'{}' is not host:port (such as 127.0.0.1:7000 or [::1]:7000)", text));
  };
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) {
    return bad();
  }
  HostPort out;
  std::string_view host = text.substr(0, colon);
  const std::string_view port = text.substr(colon + 1);
  if (host.size() >= 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  } else if (host.find(':') != std::string_view::npos) {
    return bad();
  }
  out.host = host;
  const auto parsed = std::from_chars(port.data(), port.data() + port.size(), out.port);
  if (parsed.ec != std::errc{} || parsed.ptr != port.data() + port.size()) {
    return bad();
  }
  return out;
}

physics::Result<SocketAddress> resolve(const HostPort& where, int socket_type, bool passive) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = socket_type;
  hints.ai_flags = AI_NUMERICSERV | (passive ? AI_PASSIVE : 0);
  addrinfo* found = nullptr;
  const std::string port = std::to_string(where.port);
  const int code = ::getaddrinfo(where.host.empty() ? nullptr : where.host.c_str(), port.c_str(),
                                 &hints, &found);
  if (code != 0 || found == nullptr) {
    return make_error(ErrorCode::io,
                      fmt::format("{}:{}: {}", where.host, where.port, ::gai_strerror(code)));
  }
  SocketAddress address;
  std::memcpy(&address.storage, found->ai_addr, found->ai_addrlen);
  address.length = found->ai_addrlen;
  ::freeaddrinfo(found);
  return address;
}

SocketAddress numeric_address(const std::string& host, std::uint16_t port) noexcept {
  SocketAddress address;
  sockaddr_in v4{};
  sockaddr_in6 v6{};
  if (::inet_pton(AF_INET, host.c_str(), &v4.sin_addr) == 1) {
    v4.sin_family = AF_INET;
    std::memcpy(&address.storage, &v4, sizeof(v4));
    address.length = sizeof(v4);
  } else if (::inet_pton(AF_INET6, host.c_str(), &v6.sin6_addr) == 1) {
    v6.sin6_family = AF_INET6;
    std::memcpy(&address.storage, &v6, sizeof(v6));
    address.length = sizeof(v6);
  } else {
    return address;
  }
  address.set_port(port);
  return address;
}

namespace {

physics::Result<Fd> open_socket(const SocketAddress& address, int type) {
  Fd fd(::socket(address.storage.ss_family, type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!fd) {
    return make_error(ErrorCode::io,
                      fmt::format("{}: socket: {}", to_string(address), error_text(errno)));
  }
  return fd;
}

}  // namespace

physics::Result<Fd> open_udp_bound(const SocketAddress& address) {
  auto fd = open_socket(address, SOCK_DGRAM);
  if (fd && ::bind(fd->get(), address.get(), address.length) != 0) {
    return make_error(ErrorCode::io,
                      fmt::format("udp {}: {}", to_string(address), error_text(errno)));
  }
  return fd;
}

physics::Result<Fd> open_tcp_listener(const SocketAddress& address) {
  auto fd = open_socket(address, SOCK_STREAM);
  if (!fd) {
    return fd;
  }
  set_option(fd->get(), SOL_SOCKET, SO_REUSEADDR, 1);
  if (::bind(fd->get(), address.get(), address.length) != 0 || ::listen(fd->get(), 32) != 0) {
    return make_error(ErrorCode::io,
                      fmt::format("tcp {}: {}", to_string(address), error_text(errno)));
  }
  return fd;
}

physics::Result<Fd> connect_tcp(const SocketAddress& address, std::int64_t timeout_ns) {
  auto fd = open_socket(address, SOCK_STREAM);
  if (!fd) {
    return fd;
  }
  const auto fail = [&](const std::string& why) {
    return make_error(ErrorCode::io, fmt::format("tcp {}: {}", to_string(address), why));
  };
  if (::connect(fd->get(), address.get(), address.length) != 0) {
    if (errno != EINPROGRESS) {
      return fail(error_text(errno));
    }
    pollfd wait{fd->get(), POLLOUT, 0};
    const int ready =
        ::poll(&wait, 1, static_cast<int>(std::min<std::int64_t>(timeout_ns / 1'000'000, INT_MAX)));
    if (ready <= 0) {
      return fail("no answer within the timeout");
    }
    int error = 0;
    socklen_t length = sizeof(error);
    ::getsockopt(fd->get(), SOL_SOCKET, SO_ERROR, &error, &length);
    if (error != 0) {
      return fail(error_text(error));
    }
  }
  set_option(fd->get(), IPPROTO_TCP, TCP_NODELAY, 1);
  return fd;
}

SocketAddress local_address(int fd) noexcept {
  SocketAddress address;
  address.length = sizeof(address.storage);
  if (::getsockname(fd, address.get(), &address.length) != 0) {
    address.length = 0;
  }
  return address;
}

std::string to_string(const SocketAddress& address) {
  std::array<char, NI_MAXHOST> host{};
  if (::getnameinfo(address.get(), address.length, host.data(), host.size(), nullptr, 0,
                    NI_NUMERICHOST) != 0) {
    return "unknown address";
  }
  const bool v6 = address.storage.ss_family == AF_INET6;
  return fmt::format("{}{}{}:{}", v6 ? "[" : "", host.data(), v6 ? "]" : "", address.port());
}

std::string error_text(int error) {
  return std::generic_category().message(error);
}

std::uint64_t set_receive_buffer(int fd, std::uint64_t bytes) noexcept {
  const int wanted = static_cast<int>(std::min<std::uint64_t>(bytes, INT_MAX / 2));
  if (::setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &wanted, sizeof(wanted)) != 0) {
    set_option(fd, SOL_SOCKET, SO_RCVBUF, wanted);
  }
  int granted = 0;
  socklen_t length = sizeof(granted);
  ::getsockopt(fd, SOL_SOCKET, SO_RCVBUF, &granted, &length);
  return static_cast<std::uint64_t>(granted) / 2;
}

void set_send_buffer(int fd, std::uint64_t bytes) noexcept {
  const int wanted = static_cast<int>(std::min<std::uint64_t>(bytes, INT_MAX / 2));
  if (::setsockopt(fd, SOL_SOCKET, SO_SNDBUFFORCE, &wanted, sizeof(wanted)) != 0) {
    set_option(fd, SOL_SOCKET, SO_SNDBUF, wanted);
  }
}

void set_option(int fd, int level, int name, int value) noexcept {
  // Options are wishes: what the kernel refuses shows in what the caller reads back.
  static_cast<void>(::setsockopt(fd, level, name, &value, sizeof(value)));
}

}  // namespace emit::server
