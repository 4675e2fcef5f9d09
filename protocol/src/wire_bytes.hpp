// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

/// Little-endian bytes written and read one by one: no host byte order or struct layout gets in.
namespace emit::protocol::wire {

template <class T>
using UnsignedOf = std::conditional_t<
    sizeof(T) == 8, std::uint64_t,
    std::conditional_t<sizeof(T) == 4, std::uint32_t,
                       std::conditional_t<sizeof(T) == 2, std::uint16_t, std::uint8_t>>>;

/// Writes `value` at `offset`. Precondition: it fits. Compilers turn this into one store.
template <class T>
inline void put(std::span<std::byte> out, std::size_t offset, T value) noexcept {
  const auto bits = std::bit_cast<UnsignedOf<T>>(value);
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    out[offset + i] = static_cast<std::byte>((std::uint64_t{bits} >> (8 * i)) & 0xFFu);
  }
}

/// Reads a value at `offset`. Precondition: it is within `in`.
template <class T>
[[nodiscard]] inline T get(std::span<const std::byte> in, std::size_t offset) noexcept {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    bits |= std::to_integer<std::uint64_t>(in[offset + i]) << (8 * i);
  }
  return std::bit_cast<T>(static_cast<UnsignedOf<T>>(bits));
}

}  // namespace emit::protocol::wire
