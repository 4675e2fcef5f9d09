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

/// Colour maps for display. `thermal` runs from black over violet, red and orange to white. Its
/// lightness rises evenly, so equal steps of the value look equal, and it reads in grey as well.
/// `grey` has even lightness. `difference` is dark in the middle and goes to blue below and to
/// orange above.
enum class ColorMap : std::uint8_t { thermal, grey, difference };

/// Returns the 256 colours of a map, from minimum to maximum. RT-safe after the first call.
[[nodiscard]] const std::array<Rgb, 256>& color_table(ColorMap map) noexcept;

/// Colour of pixels that are not a number, such as the sky in a temperature image. No map contains
/// it.
inline constexpr Rgb kNanColor{40, 70, 60};

/// Options of false_color().
struct FalseColorOptions {
  ColorMap map = ColorMap::thermal;
  double min_value = 280.0;  ///< this value and all below get the first colour
  /// This value and all above, +Inf too, get the last colour. It must exceed min_value.
  double max_value = 330.0;
  bool color_bar = false;  ///< adds a bar of kColorBarWidthPx at the right of the image
  std::string unit = "K";  ///< printed over the bar
};
inline constexpr std::uint32_t kColorBarWidthPx = 64;

/// Converts values to colours. `values` has width_px * height_px entries, row-major, rows down.
/// Errors: invalid_argument (wrong number of values; limits not finite or not ascending).
[[nodiscard]] physics::Result<RgbImage> false_color(std::span<const float> values,
                                                    std::uint32_t width_px, std::uint32_t height_px,
                                                    const FalseColorOptions& options);

/// Range of values for the limits of a display.
struct ValueRange {
  double min_value = 0.0;
  double max_value = 0.0;
};
/// Returns the finite values at two percentiles (0..100), or nothing if no value is finite.
[[nodiscard]] std::optional<ValueRange> percentile_range(std::span<const float> values,
                                                         double low_percent, double high_percent);

/// Draws text into an image in the built-in 5x7 font (digits, capitals, . - + / : % = and space).
/// Text outside the image is cut off. `x_px`, `y_px` is the top left corner of the first glyph.
void draw_text(RgbImage& image, std::string_view text, std::int32_t x_px, std::int32_t y_px,
               const Rgb& color, std::uint32_t scale = 1);

}  // namespace emit::image
