// SPDX-License-Identifier: Apache-2.0
#include "tool/view/time_bar.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "emit/image/false_color.hpp"

namespace emit::tool::view {
namespace {

constexpr image::Rgb kNight{18, 20, 28};
constexpr image::Rgb kDay{52, 52, 44};
constexpr image::Rgb kTick{120, 120, 120};
constexpr image::Rgb kNow{255, 190, 60};
constexpr image::Rgb kWanted{255, 255, 255};
constexpr image::Rgb kInk{215, 215, 215};

void fill_column(image::RgbImage& picture, std::uint32_t x, std::uint32_t first_y,
                 const image::Rgb& color) {
  for (std::uint32_t y = first_y; y < picture.height_px; ++y) {
    std::ranges::copy(
        color, picture.rgb.begin() + 3 * (static_cast<std::ptrdiff_t>(y) * picture.width_px + x));
  }
}

}  // namespace

double solar_hour(std::int64_t epoch_utc_ns, std::int64_t sim_time_ns,
                  double longitude_rad) noexcept {
  const double utc_h = 1e-9 / 3600.0 * static_cast<double>(epoch_utc_ns + sim_time_ns);
  const double hour = std::fmod(utc_h + longitude_rad * 12.0 / std::numbers::pi, kDayH);
  return hour < 0.0 ? hour + kDayH : hour;
}

std::optional<double> bar_hour(std::uint32_t x_px, std::uint32_t y_px, std::uint32_t width_px,
                               std::uint32_t height_px) noexcept {
  if (x_px >= width_px || y_px >= height_px || y_px + kTimeBarPx < height_px) return std::nullopt;
  return (static_cast<double>(x_px) + 0.5) / static_cast<double>(width_px) * kDayH;
}

void draw_time_bar(image::RgbImage& picture, std::uint32_t width_px, double now_h,
                   std::optional<double> wanted_h) {
  if (width_px == 0 || width_px > picture.width_px || picture.height_px < kTimeBarPx) return;
  const std::uint32_t top = picture.height_px - kTimeBarPx;
  const auto column = [&](double hour) {
    const auto x = static_cast<std::uint32_t>(hour / kDayH * static_cast<double>(width_px));
    return std::min(x, width_px - 1);
  };
  for (std::uint32_t x = 0; x < width_px; ++x) {
    const double hour = static_cast<double>(x) / static_cast<double>(width_px) * kDayH;
    fill_column(picture, x, top, hour >= 6.0 && hour < 18.0 ? kDay : kNight);
  }
  for (int hour = 0; hour < 24; hour += 3) {
    const std::uint32_t x = column(hour);
    fill_column(picture, x, picture.height_px - 4, kTick);
    image::draw_text(picture, fmt::format("{:02}", hour), static_cast<std::int32_t>(x) + 3,
                     static_cast<std::int32_t>(top) + 4, kInk);
  }
  fill_column(picture, column(now_h), top, kNow);
  if (wanted_h) fill_column(picture, column(*wanted_h), top, kWanted);
}

}  // namespace emit::tool::view
