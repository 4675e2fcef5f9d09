// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <vector>

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

}  // namespace emit::fuzz
