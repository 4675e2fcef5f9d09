// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "emit/physics/check.hpp"

/// Access to little-endian numbers in byte arrays, one byte at a time, so that neither the host's
/// byte order nor a struct's layout matters. RT-safe.
namespace emit::protocol::wire {

/// Unsigned integer with the size of T.
template <class T>
using UnsignedOf = std::conditional_t<
    sizeof(T) == 8, std::uint64_t,
    std::conditional_t<sizeof(T) == 4, std::uint32_t,
                       std::conditional_t<sizeof(T) == 2, std::uint16_t, std::uint8_t>>>;

/// Writes `value` at `offset`. Compilers turn the loop into one store.
/// @pre offset + sizeof(T) <= out.size()
template <class T>
inline void put(std::span<std::byte> out, std::size_t offset, T value) noexcept {
  EMIT_DCHECK_OP(offset + sizeof(T), <=, out.size());
  const auto bits = std::bit_cast<UnsignedOf<T>>(value);
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    out[offset + i] = static_cast<std::byte>((std::uint64_t{bits} >> (8 * i)) & 0xFFu);
  }
}

/// Returns the value at `offset`.
/// @pre offset + sizeof(T) <= in.size()
template <class T>
[[nodiscard]] inline T get(std::span<const std::byte> in, std::size_t offset) noexcept {
  EMIT_DCHECK_OP(offset + sizeof(T), <=, in.size());
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    bits |= std::to_integer<std::uint64_t>(in[offset + i]) << (8 * i);
  }
  return std::bit_cast<T>(static_cast<UnsignedOf<T>>(bits));
}

}  // namespace emit::protocol::wire
