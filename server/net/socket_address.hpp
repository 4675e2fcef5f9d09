// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/socket.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "emit/physics/error.hpp"

namespace emit::server {

/// Address and port of either family, laid out as the kernel has it: travels over rings and into
/// system calls as it is.
struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t length = 0;

  [[nodiscard]] const sockaddr* get() const noexcept {
    return reinterpret_cast<const sockaddr*>(&storage);
  }
  [[nodiscard]] sockaddr* get() noexcept { return reinterpret_cast<sockaddr*>(&storage); }
  [[nodiscard]] std::uint16_t port() const noexcept;
  void set_port(std::uint16_t port) noexcept;
  /// False for length 0, too.
  [[nodiscard]] bool is_multicast() const noexcept;
};

struct HostPort {
  std::string host;
  std::uint16_t port = 0;
};
/// "host:port", IPv6 hosts in brackets; an empty host is every address of this machine.
/// Errors (config), naming the text.
[[nodiscard]] physics::Result<HostPort> parse_host_port(std::string_view text);

enum class Transport : std::uint8_t { tcp, udp };

/// First address of a name. Blocks as long as the name service does. Errors (io), naming host and
/// reason.
[[nodiscard]] physics::Result<SocketAddress> resolve(const HostPort& where, Transport transport,
                                                     bool passive);

/// An address in numbers, without asking a name service; length 0 when it is none.
[[nodiscard]] SocketAddress numeric_address(const std::string& host, std::uint16_t port) noexcept;

/// Index of the network interface that has this address; 0: none has. Not RT-safe.
[[nodiscard]] unsigned interface_of(const SocketAddress& local) noexcept;

/// "host:port", numeric.
[[nodiscard]] std::string to_string(const SocketAddress& address);

}  // namespace emit::server
