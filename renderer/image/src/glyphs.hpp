// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>

namespace emit::image {

inline constexpr std::uint32_t kGlyphWidthPx = 5;
inline constexpr std::uint32_t kGlyphHeightPx = 7;

/// Rows from the top; bit 4 is the left column. Unknown characters give an empty glyph, small
/// letters their capitals.
[[nodiscard]] std::array<std::uint8_t, kGlyphHeightPx> glyph(char character) noexcept;

}  // namespace emit::image
