// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <variant>

#include "emit/protocol/cigi/message.hpp"

namespace emit::protocol::cigi {

/// Smallest id of the packets that users define.
inline constexpr std::uint8_t kFirstUserDefinedId = 201;

/// Returns the largest size of a packet. Only ImageGeneratorMessage has more than one.
template <class P>
[[nodiscard]] constexpr std::size_t largest_bytes() noexcept {
  if constexpr (std::is_same_v<P, ImageGeneratorMessage>) {
    return P::kMaxBytes;
  } else {
    return P::kBytes;
  }
}

/// Returns the size that a packet takes in a message.
template <class P>
[[nodiscard]] std::size_t bytes_of(const P& packet) noexcept {
  if constexpr (std::is_same_v<P, ImageGeneratorMessage>) {
    return (4 + packet.view().size() + 1 + 7) / 8 * 8;
  } else {
    return P::kBytes;
  }
}

/// Calls `call` with the packet that the variant holds. Unlike std::visit it cannot throw.
template <class Call>
void with_packet(const Packet& packet, Call&& call) {
  [&]<std::size_t... I>(std::index_sequence<I...>) {
    static_cast<void>(((packet.index() == I && (call(*std::get_if<I>(&packet)), true)) || ...));
  }
  (std::make_index_sequence<std::variant_size_v<Packet>>());
}

/// Calls `call` with a null pointer of the packet type that has this id, if the codec knows it.
template <class Call>
void with_packet_type(std::uint8_t id, Call&& call) {
  [&]<std::size_t... I>(std::index_sequence<I...>) {
    static_cast<void>(
        ((std::variant_alternative_t<I, Packet>::kId == id &&
          (call(static_cast<const std::variant_alternative_t<I, Packet>*>(nullptr)), true)) ||
         ...));
  }
  (std::make_index_sequence<std::variant_size_v<Packet>>());
}

}  // namespace emit::protocol::cigi
