// SPDX-License-Identifier: Apache-2.0
#include "net/ip_address.hpp"

#include <netinet/in.h>

namespace emit::server {

protocol::IpAddress ip_of(const sockaddr_storage& address) noexcept {
  if (address.ss_family == AF_INET6) {
    const auto& v6 = reinterpret_cast<const sockaddr_in6&>(address);
    return protocol::ip_from_bytes(v6.sin6_addr.s6_addr);
  }
  // Anything but an internet address: 0.0.0.0, which is in no network that one would allow.
  const auto& v4 = reinterpret_cast<const sockaddr_in&>(address);
  const std::uint32_t bits = address.ss_family == AF_INET ? ntohl(v4.sin_addr.s_addr) : 0;
  const std::array<std::uint8_t, 4> bytes{
      static_cast<std::uint8_t>(bits >> 24U), static_cast<std::uint8_t>(bits >> 16U),
      static_cast<std::uint8_t>(bits >> 8U), static_cast<std::uint8_t>(bits)};
  return protocol::ip_from_bytes(bytes);
}

protocol::IpAddress ip_of(const SocketAddress& address) noexcept {
  return ip_of(address.storage);
}

}  // namespace emit::server
