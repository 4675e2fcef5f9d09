// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <vector>

#include "emit/protocol/fragment.hpp"
#include "emit/protocol/frame_header.hpp"
#include "fuzz/fuzz_input.hpp"

namespace emit::fuzz {

/// Writes the correct checksum of a frame header at the front of `bytes`, so that inputs pass its
/// check. Shorter inputs, and those that do not begin like a header, stay unchanged.
inline void seal_frame_header(std::span<std::byte> bytes) {
  if (bytes.size() < protocol::kFrameHeaderBytes) return;
  const std::array magic{std::byte{'E'}, std::byte{'F'}, std::byte{'M'}, std::byte{'R'}};
  if (!std::ranges::equal(bytes.first(magic.size()), magic)) return;
  constexpr std::size_t kCrcAt = protocol::kFrameHeaderBytes - sizeof(std::uint32_t);
  const std::uint32_t crc = protocol::crc32c(bytes.first(kCrcAt));
  std::memcpy(bytes.data() + kCrcAt, &crc, sizeof crc);
}

/// Reads a datagram behind its length (u16). Bits of `instructions`: 1 corrects the checksum of the
/// frame header behind the fragment header, 2 that of the frame header at the end.
[[nodiscard]] inline std::vector<std::byte> read_datagram(InputReader& input,
                                                          std::uint8_t instructions) {
  const auto piece = input.bytes(input.number<std::uint16_t>());
  std::vector<std::byte> datagram(piece.begin(), piece.end());
  const std::span<std::byte> bytes(datagram);
  if ((instructions & 1u) != 0 && bytes.size() > protocol::kFragmentHeaderBytes) {
    seal_frame_header(bytes.subspan(protocol::kFragmentHeaderBytes));
  }
  if ((instructions & 2u) != 0 && bytes.size() > protocol::kFrameHeaderBytes) {
    seal_frame_header(bytes.last(protocol::kFrameHeaderBytes));
  }
  return datagram;
}

}  // namespace emit::fuzz
