// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>

namespace emit::image {

inline constexpr std::uint32_t kGlyphWidthPx = 5;
inline constexpr std::uint32_t kGlyphHeightPx = 7;

/// Returns the rows of a character from the top; bit 4 is the left column. Small letters give their
/// capitals, unknown characters an empty glyph.
[[nodiscard]] std::array<std::uint8_t, kGlyphHeightPx> glyph(char character) noexcept;

}  // namespace emit::image
