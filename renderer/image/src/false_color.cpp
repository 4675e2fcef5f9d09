// SPDX-License-Identifier: Apache-2.0
#include "emit/image/false_color.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "emit/physics/constants.hpp"
#include "glyphs.hpp"

namespace emit::image {
namespace {

using LinearRgb = std::array<double, 3>;

/// Converts Oklab lightness, chroma and hue to linear sRGB with the matrices published by B.
/// Ottosson.
LinearRgb linear_from_oklch(double lightness, double chroma, double hue_rad) {
  const double a = chroma * std::cos(hue_rad);
  const double b = chroma * std::sin(hue_rad);
  const double l = std::pow(lightness + 0.3963377774 * a + 0.2158037573 * b, 3.0);
  const double m = std::pow(lightness - 0.1055613458 * a - 0.0638541728 * b, 3.0);
  const double s = std::pow(lightness - 0.0894841775 * a - 1.2914855480 * b, 3.0);
  return {4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
          -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
          -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s};
}

bool in_gamut(const LinearRgb& color) {
  return std::all_of(color.begin(), color.end(), [](double c) { return c >= 0.0 && c <= 1.0; });
}

std::uint8_t srgb_byte(double linear) {
  const double c = std::clamp(linear, 0.0, 1.0);
  const double encoded = c <= 0.0031308 ? 12.92 * c : 1.055 * std::pow(c, 1.0 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(std::lround(encoded * 255.0));
}

/// One knot of a path through hue and chroma, along which the lightness is linear in the value. If
/// sRGB cannot show the chroma, the chroma is reduced and the lightness is kept.
struct Knot {
  double value_frac;
  double chroma;
  double hue_deg;
};
constexpr Knot kThermalPath[] = {{0.0, 0.02, 275.0},  {0.22, 0.16, 290.0}, {0.42, 0.22, 340.0},
                                 {0.60, 0.22, 395.0}, {0.78, 0.19, 430.0}, {0.92, 0.13, 455.0},
                                 {1.0, 0.02, 465.0}};
constexpr double kDarkest = 0.06;
constexpr double kLightest = 0.99;

Rgb thermal_color(double value_frac) {
  std::size_t upper = 1;
  while (upper + 1 < std::size(kThermalPath) && kThermalPath[upper].value_frac < value_frac) {
    ++upper;
  }
  const Knot& from = kThermalPath[upper - 1];
  const Knot& to = kThermalPath[upper];
  const double t = (value_frac - from.value_frac) / (to.value_frac - from.value_frac);
  const double lightness = kDarkest + (kLightest - kDarkest) * value_frac;
  const double hue_rad = std::lerp(from.hue_deg, to.hue_deg, t) * physics::kDegree;
  double low = 0.0;
  double high = std::lerp(from.chroma, to.chroma, t);
  // Find the largest chroma that sRGB can show, by bisection.
  if (!in_gamut(linear_from_oklch(lightness, high, hue_rad))) {
    for (int halving = 0; halving < 30; ++halving) {
      const double middle = 0.5 * (low + high);
      (in_gamut(linear_from_oklch(lightness, middle, hue_rad)) ? low : high) = middle;
    }
    high = low;
  }
  const LinearRgb color = linear_from_oklch(lightness, high, hue_rad);
  return {srgb_byte(color[0]), srgb_byte(color[1]), srgb_byte(color[2])};
}

Rgb grey_color(double value_frac) {
  const double lightness = kDarkest + (kLightest - kDarkest) * value_frac;
  const std::uint8_t level = srgb_byte(lightness * lightness * lightness);
  return {level, level, level};
}

Rgb difference_color(double value_frac) {
  constexpr double kBlueDeg = 255.0;
  constexpr double kOrangeDeg = 55.0;
  const double strength = std::abs(2.0 * value_frac - 1.0);
  const double lightness = 0.16 + 0.62 * strength;
  const double hue_rad = (value_frac < 0.5 ? kBlueDeg : kOrangeDeg) * physics::kDegree;
  const LinearRgb color = linear_from_oklch(lightness, 0.14 * strength, hue_rad);
  return {srgb_byte(color[0]), srgb_byte(color[1]), srgb_byte(color[2])};
}

std::array<Rgb, 256> build_table(Rgb (*color)(double)) {
  std::array<Rgb, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    table[i] = color(static_cast<double>(i) / 255.0);
  }
  return table;
}

void set_pixel(RgbImage& image, std::uint32_t x, std::uint32_t y, const Rgb& color) {
  std::copy(color.begin(), color.end(),
            image.rgb.begin() + 3 * (static_cast<std::ptrdiff_t>(y) * image.width_px + x));
}

constexpr std::uint32_t kBarLeftPx = 8;
constexpr std::uint32_t kBarWidthPx = 14;
constexpr std::uint32_t kBarTicks = 5;
constexpr Rgb kBarBackground{24, 24, 24};
constexpr Rgb kBarText{235, 235, 235};

void draw_color_bar(RgbImage& image, std::uint32_t left_px, const FalseColorOptions& options) {
  const auto& table = color_table(options.map);
  for (std::uint32_t y = 0; y < image.height_px; ++y) {
    for (std::uint32_t x = left_px; x < image.width_px; ++x) {
      set_pixel(image, x, y, kBarBackground);
    }
  }
  const std::uint32_t margin = 2 * kGlyphHeightPx;
  if (image.height_px < 3 * margin) {
    return;  // the image has no room for a legible bar
  }
  const std::uint32_t top = margin;
  const std::uint32_t rows = image.height_px - margin - kGlyphHeightPx - 1;
  const std::uint32_t span = rows - top;
  for (std::uint32_t y = top; y <= rows; ++y) {
    const double frac = static_cast<double>(rows - y) / span;
    const auto entry = static_cast<std::size_t>(std::lround(frac * 255.0));
    for (std::uint32_t x = 0; x < kBarWidthPx; ++x) {
      set_pixel(image, left_px + kBarLeftPx + x, y, table[entry]);
    }
  }
  const double range = options.max_value - options.min_value;
  const int decimals = std::clamp(static_cast<int>(std::ceil(1.0 - std::log10(range / 4.0))), 0, 4);
  const auto text_left = static_cast<std::int32_t>(left_px + kBarLeftPx + kBarWidthPx + 4);
  for (std::uint32_t tick = 0; tick < kBarTicks; ++tick) {
    const double frac = static_cast<double>(tick) / (kBarTicks - 1);
    const auto y =
        static_cast<std::int32_t>(rows) - static_cast<std::int32_t>(std::lround(frac * span));
    const double value = options.min_value + frac * range;
    std::string text = fmt::format("{:.{}f}", value, decimals);
    if (text.size() > 6) {
      text = fmt::format("{:.2g}", value);
    }
    draw_text(image, text, text_left, y - static_cast<std::int32_t>(kGlyphHeightPx / 2), kBarText);
  }
  draw_text(image, options.unit, static_cast<std::int32_t>(left_px + kBarLeftPx), 2, kBarText);
}

}  // namespace

const std::array<Rgb, 256>& color_table(ColorMap map) noexcept {
  static const std::array<Rgb, 256> thermal = build_table(thermal_color);
  static const std::array<Rgb, 256> grey = build_table(grey_color);
  static const std::array<Rgb, 256> difference = build_table(difference_color);
  if (map == ColorMap::difference) return difference;
  return map == ColorMap::grey ? grey : thermal;
}

physics::Result<RgbImage> false_color(std::span<const float> values, std::uint32_t width_px,
                                      std::uint32_t height_px, const FalseColorOptions& options) {
  if (width_px == 0 || height_px == 0 || values.size() != std::size_t{width_px} * height_px) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               fmt::format("false colour: {} values for {}x{} pixels",
                                           values.size(), width_px, height_px));
  }
  if (!std::isfinite(options.min_value) || !std::isfinite(options.max_value) ||
      !(options.min_value < options.max_value)) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               fmt::format("false colour: limits {} .. {} are not ascending",
                                           options.min_value, options.max_value));
  }
  const auto& table = color_table(options.map);
  RgbImage image;
  image.width_px = width_px + (options.color_bar ? kColorBarWidthPx : 0U);
  image.height_px = height_px;
  image.rgb.assign(std::size_t{3} * image.width_px * image.height_px, 0);
  const double scale = 255.0 / (options.max_value - options.min_value);
  for (std::uint32_t y = 0; y < height_px; ++y) {
    for (std::uint32_t x = 0; x < width_px; ++x) {
      const double value = static_cast<double>(values[std::size_t{y} * width_px + x]);
      if (std::isnan(value)) {
        set_pixel(image, x, y, kNanColor);
        continue;
      }
      const double entry = std::clamp((value - options.min_value) * scale, 0.0, 255.0);
      set_pixel(image, x, y, table[static_cast<std::size_t>(std::lround(entry))]);
    }
  }
  if (options.color_bar) {
    draw_color_bar(image, width_px, options);
  }
  return image;
}

std::optional<ValueRange> percentile_range(std::span<const float> values, double low_percent,
                                           double high_percent) {
  std::vector<float> finite;
  finite.reserve(values.size());
  for (const float value : values) {
    if (std::isfinite(value)) {
      finite.push_back(value);
    }
  }
  if (finite.empty()) {
    return std::nullopt;
  }
  const auto at = [&](double percent) {
    const double position =
        std::clamp(percent, 0.0, 100.0) / 100.0 * static_cast<double>(finite.size() - 1);
    const auto nth = finite.begin() + std::lround(position);
    std::nth_element(finite.begin(), nth, finite.end());
    return static_cast<double>(*nth);
  };
  const double low = at(low_percent);
  return ValueRange{low, at(high_percent)};
}

void draw_text(RgbImage& image, std::string_view text, std::int32_t x_px, std::int32_t y_px,
               const Rgb& color, std::uint32_t scale) {
  std::int64_t left = x_px;
  for (const char character : text) {
    const auto rows = glyph(character);
    for (std::uint32_t row = 0; row < kGlyphHeightPx * scale; ++row) {
      for (std::uint32_t column = 0; column < kGlyphWidthPx * scale; ++column) {
        const std::uint32_t bit = kGlyphWidthPx - 1 - column / scale;
        const std::int64_t x = left + column;
        const std::int64_t y = std::int64_t{y_px} + row;
        const bool inside = x >= 0 && y >= 0 && x < image.width_px && y < image.height_px;
        if (inside && ((std::uint32_t{rows[row / scale]} >> bit) & 1U) != 0) {
          set_pixel(image, static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y), color);
        }
      }
    }
    left += (kGlyphWidthPx + 1) * scale;
  }
}

}  // namespace emit::image
