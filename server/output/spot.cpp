// SPDX-License-Identifier: Apache-2.0
#include "output/spot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "emit/image/exr_image.hpp"
#include "emit/physics/check.hpp"

namespace emit::server {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

namespace {

/// A Gaussian is cut where 1e-5 of its light lies beyond.
constexpr double kGaussianReach = 4.5;
/// Most light that may lie beyond the pixels with a share of their own.
constexpr double kMostVeilFrac = 0.1;
/// An Airy pattern has shares of its own up to this many times wavelength times f-number. Some
/// hundredths of its light lie beyond, in the veil.
constexpr double kAiryReach = 12.0;

Spot gaussian_spot(double sigma_px) {
  Spot spot;
  spot.radius_px = static_cast<std::uint32_t>(
      std::clamp(std::ceil(kGaussianReach * sigma_px), 1.0, double{kMaxSpotRadiusPx}));
  // Integrate over pixels along one axis. The shares beyond the reach go to those within it.
  std::vector<double> line(spot.side());
  const double scale = 1.0 / (std::numbers::sqrt2 * sigma_px);
  for (std::size_t i = 0; i < line.size(); ++i) {
    const double from_px = static_cast<double>(i) - spot.radius_px - 0.5;
    line[i] = 0.5 * (std::erf((from_px + 1.0) * scale) - std::erf(from_px * scale));
  }
  const double sum = std::accumulate(line.begin(), line.end(), 0.0);
  for (const double y : line) {
    for (const double x : line) spot.share_frac.push_back(x / sum * (y / sum));
  }
  return spot;
}

/// Returns 2 J1(x) / x, which is 1 at 0.
double jinc(double x) {
  return x < 1e-6 ? 1.0 : 2.0 * std::cyl_bessel_j(1.0, x) / x;
}

/// Returns the irradiance of an Airy pattern of unit power at a distance, 1/px^2 (Born and Wolf,
/// Principles of Optics, 8.6.2).
double airy_per_px2(double distance_px, double airy_px, double obscuration_frac) {
  const double x = std::numbers::pi * distance_px / airy_px;
  const double e2 = obscuration_frac * obscuration_frac;
  const double amplitude = (jinc(x) - e2 * jinc(obscuration_frac * x)) / (1.0 - e2);
  const double peak_per_px2 = std::numbers::pi * (1.0 - e2) / (4.0 * airy_px * airy_px);
  return peak_per_px2 * amplitude * amplitude;
}

Spot airy_spot(double airy_px, double obscuration_frac) {
  Spot spot;
  spot.radius_px = static_cast<std::uint32_t>(
      std::clamp(std::ceil(kAiryReach * airy_px), 3.0, double{kMaxSpotRadiusPx}));
  // Tabulate the pattern by distance, finer than its rings, and add it up over each pixel.
  constexpr double kStepsPerRing = 64.0;
  const double step_px = airy_px / kStepsPerRing;
  const double end_px = std::numbers::sqrt2 * (spot.radius_px + 1.0);
  std::vector<double> table(static_cast<std::size_t>(end_px / step_px) + 3);
  for (std::size_t i = 0; i < table.size(); ++i) {
    table[i] = airy_per_px2(static_cast<double>(i) * step_px, airy_px, obscuration_frac);
  }
  const auto per_px2 = [&](double x_px, double y_px) {
    const double at = std::hypot(x_px, y_px) / step_px;
    const auto i = static_cast<std::size_t>(at);
    return std::lerp(table[i], table[i + 1], at - static_cast<double>(i));
  };
  const int parts = std::clamp(static_cast<int>(std::ceil(24.0 / airy_px)), 12, 96);
  const auto share_of = [&](std::uint32_t x_px, std::uint32_t y_px) {
    double sum = 0.0;
    for (int j = 0; j < parts; ++j) {
      for (int i = 0; i < parts; ++i) {
        sum += per_px2(x_px - 0.5 + (i + 0.5) / parts, y_px - 0.5 + (j + 0.5) / parts);
      }
    }
    return sum / (parts * parts);
  };
  // An octant holds everything.
  const std::uint32_t radius = spot.radius_px;
  std::vector<double> quarter((radius + 1) * (radius + 1));
  for (std::uint32_t y = 0; y <= radius; ++y) {
    for (std::uint32_t x = 0; x <= y; ++x) {
      quarter[y * (radius + 1) + x] = quarter[x * (radius + 1) + y] = share_of(x, y);
    }
  }
  double sum = 0.0;
  for (std::size_t row = 0; row < spot.side(); ++row) {
    for (std::size_t column = 0; column < spot.side(); ++column) {
      const std::size_t y = row < radius ? radius - row : row - radius;
      const std::size_t x = column < radius ? radius - column : column - radius;
      spot.share_frac.push_back(quarter[y * (radius + 1) + x]);
      sum += spot.share_frac.back();
    }
  }
  // The sum over parts of pixels can exceed 1 by its own error where the reach holds all light.
  if (sum > 1.0) {
    for (double& share : spot.share_frac) share /= sum;
  }
  spot.veil_frac = std::max(1.0 - sum, 0.0);
  return spot;
}

Result<Spot> read_spot(const std::filesystem::path& file) {
  const auto map = image::read_exr(file);
  if (!map) return tl::unexpected(map.error());
  const auto fail = [&](const std::string& what) {
    return make_error(ErrorCode::config, fmt::format("{}: {}", file.string(), what));
  };
  const image::ExrChannel* channel = map->find("spot");
  if (channel == nullptr) return fail("channel 'spot' is missing");
  if (map->width_px != map->height_px || map->width_px % 2 == 0 ||
      map->width_px > 2 * kMaxSpotRadiusPx + 1) {
    return fail(
        fmt::format("a spot has as many columns as rows, an odd number up to {}, but this "
                    "one has {} x {}",
                    2 * kMaxSpotRadiusPx + 1, map->width_px, map->height_px));
  }
  Spot spot;
  spot.radius_px = map->width_px / 2;
  double sum = 0.0;
  for (std::size_t i = 0; i < channel->pixels.size(); ++i) {
    const float share = channel->pixels[i];
    if (!(share >= 0.0F) || !std::isfinite(share)) {
      return fail(fmt::format("'spot' is {} at column {}, row {}; it must be 0 or more", share,
                              i % map->width_px, i / map->width_px));
    }
    sum += share;
    spot.share_frac.push_back(share);
  }
  if (!(sum > 0.0)) return fail("'spot' is 0 everywhere");
  for (double& share : spot.share_frac) share /= sum;
  return spot;
}

}  // namespace

Result<Spot> make_spot(const scene::ChannelOptics& settings) {
  EMIT_CHECK(settings.spot != scene::SpotKind::none);
  switch (settings.spot) {
    case scene::SpotKind::gaussian:
      return gaussian_spot(settings.sigma_px);
    case scene::SpotKind::airy: {
      Spot spot = airy_spot(settings.airy_px, settings.obscuration_frac);
      if (spot.veil_frac <= kMostVeilFrac) return spot;
      return make_error(
          ErrorCode::config,
          fmt::format("optics.airy_px = {} with obscuration_frac = {}: {:.0f} % of the light lies "
                      "beyond {} px, at most {:.0f} % can be drawn as an even veil",
                      settings.airy_px, settings.obscuration_frac, 100.0 * spot.veil_frac,
                      spot.radius_px, 100.0 * kMostVeilFrac));
    }
    default:
      return read_spot(settings.spot_file);
  }
}

}  // namespace emit::server
