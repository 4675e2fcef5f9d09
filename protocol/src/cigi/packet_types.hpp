// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <variant>

#include "cigi/ig_layouts4.hpp"
#include "emit/protocol/cigi/message.hpp"

namespace emit::protocol::cigi {

/// Smallest id of the packets that users define, in both versions; the largest id of 4.0 is that of
/// Start Of Frame.
inline constexpr std::uint16_t kFirstUserDefinedId = 201;
inline constexpr std::uint16_t kFirstUserDefinedIdV4 = 0x8000;

/// Returns whether users define the packets of an id.
[[nodiscard]] constexpr bool user_defined(std::uint16_t id, Version version) noexcept {
  return version == Version::v3_3 ? id >= kFirstUserDefinedId
                                  : id >= kFirstUserDefinedIdV4 && id < 0xFFFF;
}

/// Returns the offset of a text in its packet.
[[nodiscard]] constexpr std::size_t text_at(Version version) noexcept {
  return version == Version::v3_3 ? 4 : 8;
}

/// Returns the size that a packet takes in a message, or 0 where the version has no such packet.
template <class P>
[[nodiscard]] std::size_t bytes_of(const P& packet, Version version) noexcept {
  if constexpr (std::is_same_v<P, ImageGeneratorMessage>) {
    return (text_at(version) + packet.view().size() + 1 + 7) / 8 * 8;
  } else {
    return P::kWire.of(version).bytes;
  }
}

/// Returns whether a message begins with a packet of this type.
template <class P>
[[nodiscard]] constexpr bool begins_message() noexcept {
  return std::is_same_v<P, IgControl> || std::is_same_v<P, StartOfFrame>;
}

/// Copies the fields of a packet that the version has, from or to the bytes of `io`.
template <class Io, class P>
void copy_fields(Io& io, P& packet, Version version) {
  if constexpr (P::kWire.exists(Version::v3_3)) {
    if (version == Version::v3_3) layout(io, packet);
  }
  if constexpr (P::kWire.exists(Version::v4_0)) {
    if (version == Version::v4_0) layout_v4(io, packet);
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

/// Calls `call` with a null pointer of the packet type that has this id in this version, if the
/// codec knows it.
template <class Call>
void with_packet_type(std::uint16_t id, Version version, Call&& call) {
  [&]<std::size_t... I>(std::index_sequence<I...>) {
    static_cast<void>(
        ((std::variant_alternative_t<I, Packet>::kWire.exists(version) &&
          std::variant_alternative_t<I, Packet>::kWire.of(version).id == id &&
          (call(static_cast<const std::variant_alternative_t<I, Packet>*>(nullptr)), true)) ||
         ...));
  }
  (std::make_index_sequence<std::variant_size_v<Packet>>());
}

}  // namespace emit::protocol::cigi
