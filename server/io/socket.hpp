// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/socket.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "emit/physics/error.hpp"
#include "rt/fd.hpp"

/// Sockets as emitd uses them: non-blocking, close-on-exec. Setup only unless noted.
namespace emit::server {

struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t length = 0;

  [[nodiscard]] const sockaddr* get() const noexcept {
    return reinterpret_cast<const sockaddr*>(&storage);
  }
  [[nodiscard]] sockaddr* get() noexcept { return reinterpret_cast<sockaddr*>(&storage); }
  [[nodiscard]] std::uint16_t port() const noexcept;
  void set_port(std::uint16_t port) noexcept;
};

struct HostPort {
  std::string host;
  std::uint16_t port = 0;
};
/// "host:port", IPv6 hosts in brackets; an empty host is every address of this machine.
/// Errors (config), naming the text.
[[nodiscard]] physics::Result<HostPort> parse_host_port(std::string_view text);

/// First address of a name. Errors (io), naming host and reason.
[[nodiscard]] physics::Result<SocketAddress> resolve(const HostPort& where, int socket_type,
                                                     bool passive);

/// An address in numbers, without asking a name service; length 0 when it is none.
[[nodiscard]] SocketAddress numeric_address(const std::string& host, std::uint16_t port) noexcept;

/// Errors (io): address in use and so on, naming the address.
[[nodiscard]] physics::Result<Fd> open_udp_bound(const SocketAddress& address);
[[nodiscard]] physics::Result<Fd> open_tcp_listener(const SocketAddress& address);
/// Waits up to `timeout_ns` for the connection.
[[nodiscard]] physics::Result<Fd> connect_tcp(const SocketAddress& address,
                                              std::int64_t timeout_ns);

[[nodiscard]] SocketAddress local_address(int fd) noexcept;
/// "host:port", numeric.
[[nodiscard]] std::string to_string(const SocketAddress& address);
/// Text of an errno. Thread: any.
[[nodiscard]] std::string error_text(int error);

/// Asks for a receive buffer; past the system's limit where privileges allow. Returns the bytes
/// granted, in the unit of net.core.rmem_max (the kernel books twice that).
std::uint64_t set_receive_buffer(int fd, std::uint64_t bytes) noexcept;
void set_send_buffer(int fd, std::uint64_t bytes) noexcept;
void set_option(int fd, int level, int name, int value) noexcept;

}  // namespace emit::server
