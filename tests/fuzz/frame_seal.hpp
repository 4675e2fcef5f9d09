// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <vector>

#include "emit/protocol/fragment.hpp"
#include "emit/protocol/frame_header.hpp"
#include "fuzz/fuzz_input.hpp"

namespace emit::fuzz {

/// Writes the checksum that a frame header at the front of `bytes` ought to have, so that inputs
/// get past it. Leaves shorter ones, and what does not begin like a header, alone.
inline void seal_frame_header(std::span<std::byte> bytes) {
  if (bytes.size() < protocol::kFrameHeaderBytes) return;
  const std::array magic{std::byte{'E'}, std::byte{'F'}, std::byte{'M'}, std::byte{'R'}};
  if (!std::ranges::equal(bytes.first(magic.size()), magic)) return;
  constexpr std::size_t kCrcAt = protocol::kFrameHeaderBytes - sizeof(std::uint32_t);
  const std::uint32_t crc = protocol::crc32c(bytes.first(kCrcAt));
  std::memcpy(bytes.data() + kCrcAt, &crc, sizeof crc);
}

/// A datagram of fragments behind its length (u16). Bits of `instructions`: 1 seal the frame header
/// behind the fragment's, 2 seal the one at the end.
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
