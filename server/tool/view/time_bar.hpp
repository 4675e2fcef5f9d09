// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>

#include "emit/image/png_image.hpp"

/// Bar over the local solar day at the lower edge of the viewer's picture.
namespace emit::tool::view {

inline constexpr std::uint32_t kTimeBarPx = 16;
inline constexpr double kDayH = 24.0;

/// Returns the local solar time of an instant, 0..24 h: UTC and four minutes per degree of
/// longitude.
[[nodiscard]] double solar_hour(std::int64_t epoch_utc_ns, std::int64_t sim_time_ns,
                                double longitude_rad) noexcept;

/// Returns the hour at a column of the bar; empty where the place is not on the bar.
[[nodiscard]] std::optional<double> bar_hour(std::uint32_t x_px, std::uint32_t y_px,
                                             std::uint32_t width_px,
                                             std::uint32_t height_px) noexcept;

/// Draws the bar over the lowest rows of the first `width_px` columns, with the hour of now and
/// the one that the user points at.
void draw_time_bar(image::RgbImage& picture, std::uint32_t width_px, double now_h,
                   std::optional<double> wanted_h);

}  // namespace emit::tool::view
