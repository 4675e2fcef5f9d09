// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "emit/physics/check.hpp"
#include "emit/protocol/cigi/common.hpp"
#include "wire_bytes.hpp"

/// Access to the fields of one packet in either byte order. Reader and writer have the same
/// members, so that one description of a packet's layout serves both.
namespace emit::protocol::cigi {

/// Returns the place of byte `i` of a number's low-to-high bytes.
[[nodiscard]] constexpr std::size_t byte_at(std::size_t i, std::size_t size,
                                            ByteOrder order) noexcept {
  return order == ByteOrder::little ? i : size - 1 - i;
}

/// Copies fields out of a packet's bytes.
class FieldReader {
 public:
  FieldReader(std::span<const std::byte> packet, ByteOrder order)
      : packet_(packet), order_(order) {}

  template <class T>
  void number(std::size_t offset, T& value) const noexcept {
    EMIT_DCHECK_OP(offset + sizeof(T), <=, packet_.size());
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      bits |= std::to_integer<std::uint64_t>(packet_[offset + byte_at(i, sizeof(T), order_)])
              << (8 * i);
    }
    value = std::bit_cast<T>(static_cast<wire::UnsignedOf<T>>(bits));
  }
  /// Reads `count` bits of a byte, counted from the least significant one.
  template <class T>
  void bits(std::size_t offset, unsigned first, unsigned count, T& value) const noexcept {
    EMIT_DCHECK_OP(offset, <, packet_.size());
    const auto byte = std::to_integer<unsigned>(packet_[offset]);
    value = static_cast<T>((byte >> first) & ((1u << count) - 1u));
  }
  /// Returns the offset of the upper byte of a word of 16 bits.
  [[nodiscard]] std::size_t high_byte(std::size_t offset) const noexcept {
    return offset + byte_at(1, 2, order_);
  }
  /// Reads a text up to its zero from the rest of the packet and fills the array with zeros. The
  /// text has no end if the zero comes later than the array can hold it.
  template <std::size_t N>
  void text(std::size_t offset, std::array<char, N>& value) noexcept {
    value.fill('\0');
    for (std::size_t i = offset; i < packet_.size() && i - offset < N; ++i) {
      const char letter = std::to_integer<char>(packet_[i]);
      if (letter == '\0') return;
      value[i - offset] = letter;
    }
    text_ended_ = false;
  }
  [[nodiscard]] bool text_ended() const noexcept { return text_ended_; }

 private:
  std::span<const std::byte> packet_;
  ByteOrder order_;
  bool text_ended_ = true;
};

/// Copies fields into a packet's bytes, which are zero before.
class FieldWriter {
 public:
  FieldWriter(std::span<std::byte> packet, ByteOrder order) : packet_(packet), order_(order) {}

  template <class T>
  void number(std::size_t offset, const T& value) const noexcept {
    EMIT_DCHECK_OP(offset + sizeof(T), <=, packet_.size());
    const std::uint64_t bits = std::bit_cast<wire::UnsignedOf<T>>(value);
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      packet_[offset + byte_at(i, sizeof(T), order_)] =
          static_cast<std::byte>((bits >> (8 * i)) & 0xFFu);
    }
  }
  template <class T>
  void bits(std::size_t offset, unsigned first, unsigned count, const T& value) const noexcept {
    EMIT_DCHECK_OP(offset, <, packet_.size());
    const unsigned part = (static_cast<unsigned>(value) & ((1u << count) - 1u)) << first;
    packet_[offset] |= static_cast<std::byte>(part);
  }
  [[nodiscard]] std::size_t high_byte(std::size_t offset) const noexcept {
    return offset + byte_at(1, 2, order_);
  }
  template <std::size_t N>
  void text(std::size_t offset, const std::array<char, N>& value) const noexcept {
    for (std::size_t i = offset; i < packet_.size() && i - offset < N; ++i) {
      packet_[i] = static_cast<std::byte>(value[i - offset]);
    }
  }

 private:
  std::span<std::byte> packet_;
  ByteOrder order_;
};

}  // namespace emit::protocol::cigi
