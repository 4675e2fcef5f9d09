// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "emit/physics/error.hpp"

namespace emit::protocol {

/// Internet address without port. IPv4 addresses use the first 4 bytes. An IPv4 address mapped into
/// IPv6 (::ffff:a.b.c.d) counts as the IPv4 address.
struct IpAddress {
  bool v4 = true;
  std::array<std::uint8_t, 16> bytes{};

  /// Returns true for 127.0.0.0/8 and ::1. RT-safe.
  [[nodiscard]] bool is_loopback() const noexcept;
  friend bool operator==(const IpAddress&, const IpAddress&) = default;
};

/// Returns the address of 4 or 16 bytes in network order. Thread: any. RT-safe.
[[nodiscard]] IpAddress ip_from_bytes(std::span<const std::uint8_t> bytes) noexcept;
/// Reads a numeric address such as "10.1.2.3" or "fd00::1". Returns nothing when the text is none.
/// Thread: any.
[[nodiscard]] std::optional<IpAddress> parse_ip(std::string_view text) noexcept;
[[nodiscard]] std::string to_string(const IpAddress& address);

/// Set of the addresses that begin with the same bits (RFC 4632, RFC 4291 section 2.3).
struct Network {
  IpAddress first;                ///< the bits behind the prefix are 0
  std::uint8_t prefix_bits = 32;  ///< length of the prefix, 0..32 for IPv4, 0..128 for IPv6

  /// Returns true when the address is in the set. ::/0 contains no IPv4 address. Thread: any.
  /// RT-safe.
  [[nodiscard]] bool contains(const IpAddress& address) const noexcept;
  friend bool operator==(const Network&, const Network&) = default;
};

/// Reads "10.0.0.0/8", "fd00::/8" or one address. Errors (config) name the text: it is no address,
/// its prefix is too long, or bits behind the prefix are set.
[[nodiscard]] physics::Result<Network> parse_network(std::string_view text);
[[nodiscard]] std::string to_string(const Network& network);

[[nodiscard]] inline bool any_contains(std::span<const Network> networks,
                                       const IpAddress& address) noexcept {
  for (const Network& network : networks) {
    if (network.contains(address)) return true;
  }
  return false;
}

}  // namespace emit::protocol
