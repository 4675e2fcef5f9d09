// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "emit/image/png_image.hpp"

namespace emit::image {

/// `thermal`: black, violet, red, orange, white; lightness rises evenly, so equal steps of the
/// value look equal, and it reads in grey as well. `grey`: even lightness.
enum class ColorMap : std::uint8_t { thermal, grey };
[[nodiscard]] std::optional<ColorMap> color_map_from(std::string_view name) noexcept;

/// 256 entries from minimum to maximum. RT-safe after the first call.
[[nodiscard]] const std::array<Rgb, 256>& color_table(ColorMap map) noexcept;

/// Pixels that are not a number (sky in a temperature image); not a colour of any map.
inline constexpr Rgb kNanColor{40, 70, 60};

struct FalseColorOptions {
  ColorMap map = ColorMap::thermal;
  double min_value = 280.0;  ///< and below: first colour
  double max_value = 330.0;  ///< and above, +Inf too: last colour; must exceed min_value
  bool color_bar = false;    ///< appended at the right: picture gets kColorBarWidthPx wider
  std::string unit = "K";    ///< printed over the bar
};
inline constexpr std::uint32_t kColorBarWidthPx = 64;

/// Errors: invalid_argument (sizes, limits not finite or not ascending).
[[nodiscard]] physics::Result<RgbImage> false_color(std::span<const float> values,
                                                    std::uint32_t width_px, std::uint32_t height_px,
                                                    const FalseColorOptions& options);

/// Smallest and largest finite value between two percentiles (0..100), for display limits;
/// nothing when no value is finite.
struct ValueRange {
  double min_value = 0.0;
  double max_value = 0.0;
};
[[nodiscard]] std::optional<ValueRange> percentile_range(std::span<const float> values,
                                                         double low_percent, double high_percent);

/// Writes text in the built-in 5x7 font (digits, capitals, . - + / space) into the picture; what
/// falls outside is cut off. `x_px`, `y_px`: top left of the first glyph.
void draw_text(RgbImage& image, std::string_view text, std::int32_t x_px, std::int32_t y_px,
               const Rgb& color, std::uint32_t scale = 1);

}  // namespace emit::image
