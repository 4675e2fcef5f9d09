// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/physics/check.hpp"
#include "wire_bytes.hpp"

/// Access to big-endian fields. Reader and writer have the same member, so that one description of
/// a layout serves both. RT-safe.
namespace emit::protocol {

/// Copies fields out of bytes.
class BigEndianReader {
 public:
  explicit BigEndianReader(std::span<const std::byte> bytes) : bytes_(bytes) {}
  /// @pre the field lies within the bytes
  template <class T>
  void number(std::size_t offset, T& value) const noexcept {
    EMIT_DCHECK_OP(offset + sizeof(T), <=, bytes_.size());
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      bits = (bits << 8) | std::to_integer<std::uint64_t>(bytes_[offset + i]);
    }
    value = std::bit_cast<T>(static_cast<wire::UnsignedOf<T>>(bits));
  }

 private:
  std::span<const std::byte> bytes_;
};

/// Copies fields into bytes.
class BigEndianWriter {
 public:
  explicit BigEndianWriter(std::span<std::byte> bytes) : bytes_(bytes) {}
  /// @pre the field lies within the bytes
  template <class T>
  void number(std::size_t offset, const T& value) const noexcept {
    EMIT_DCHECK_OP(offset + sizeof(T), <=, bytes_.size());
    const std::uint64_t bits = std::bit_cast<wire::UnsignedOf<T>>(value);
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      bytes_[offset + i] = static_cast<std::byte>((bits >> (8 * (sizeof(T) - 1 - i))) & 0xFFu);
    }
  }

 private:
  std::span<std::byte> bytes_;
};

}  // namespace emit::protocol
