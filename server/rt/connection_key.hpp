// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <string>

namespace emit::server {

/// Connections are named by their place in the receiver's table and how often it was used.
inline constexpr std::uint32_t kConnectionPlaceBits = 10;
inline constexpr std::uint32_t kMaxConnections = 1u << kConnectionPlaceBits;
[[nodiscard]] constexpr std::uint32_t connection_place(std::uint64_t key) noexcept {
  return static_cast<std::uint32_t>(key) & (kMaxConnections - 1);
}

/// "PLACE.USE", as the log names a connection.
[[nodiscard]] inline std::string connection_name(std::uint64_t key) {
  return std::to_string(connection_place(key)) + "." + std::to_string(key >> kConnectionPlaceBits);
}

}  // namespace emit::server
