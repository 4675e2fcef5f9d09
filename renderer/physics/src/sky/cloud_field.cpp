// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/sky/cloud_field.hpp"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "emit/physics/check.hpp"
#include "emit/physics/clear_sky.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/surface/power_law_field.hpp"

namespace emit::physics {
namespace {

/// Half width of the edge of a cloud, in standard deviations of the field.
constexpr double kEdgeSd = 0.2;
/// Slope of the drift in the axes of the tile. No other slope takes a line over a tile that repeats
/// so long to come close to itself.
constexpr double kDriftSlope = 0.6180339887498949;

/// Opacity where the field has a value: a smooth step around the threshold.
double edge_frac(double value_sd, double threshold_sd) noexcept {
  const double x = std::clamp(0.5 + 0.5 * (value_sd - threshold_sd) / kEdgeSd, 0.0, 1.0);
  return x * x * (3.0 - 2.0 * x);
}

double mean_of(std::span<const float> values, double threshold_sd) noexcept {
  double sum = 0.0;
  for (const float value : values) sum += edge_frac(static_cast<double>(value), threshold_sd);
  return sum / static_cast<double>(values.size());
}

/// Index of the first texel of a level.
std::size_t first_of(std::size_t level) noexcept {
  std::size_t first = 0;
  for (std::size_t l = 0; l < level; ++l) {
    const std::size_t side = CloudField::kSide >> l;
    first += side * side;
  }
  return first;
}

double wrapped(double x) noexcept {
  return x - std::floor(x);
}

}  // namespace

CloudField::CloudField(const Clouds& clouds) : clouds_(clouds) {
  EMIT_CHECK(clouds.cover_frac >= 0.0 && clouds.cover_frac < 1.0);
  EMIT_CHECK(clouds.base_m > 0.0);
  const std::vector<FieldLevel> levels = power_law_field({.period_m = clouds.period_m(),
                                                          .shortest_m = clouds.shortest_m,
                                                          .longest_m = clouds.longest_m,
                                                          .slope = clouds.slope,
                                                          .seed = clouds.seed},
                                                         kSide, 1);
  // Find the threshold at which the tile has the cover.
  const std::vector<float>& values = levels.front().values;
  double low_sd = -8.0;
  double high_sd = 8.0;
  for (int i = 0; i < 40; ++i) {
    const double middle_sd = 0.5 * (low_sd + high_sd);
    (mean_of(values, middle_sd) > clouds.cover_frac ? low_sd : high_sd) = middle_sd;
  }
  texels_.resize(first_of(kLevels));
  double sum = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double frac = edge_frac(static_cast<double>(values[i]), 0.5 * (low_sd + high_sd));
    texels_[i] = static_cast<std::uint16_t>(std::lround(kMostValue * frac));
    sum += texels_[i];
  }
  mean_frac_ = sum / kMostValue / static_cast<double>(values.size());
  // Average four texels each into the next level.
  for (std::size_t l = 1; l < kLevels; ++l) {
    const std::size_t side = kSide >> l;
    const std::span<const std::uint16_t> from = level(l - 1);
    std::uint16_t* to = texels_.data() + first_of(l);
    for (std::size_t y = 0; y < side; ++y) {
      for (std::size_t x = 0; x < side; ++x) {
        const std::size_t at = 2 * (y * 2 * side + x);
        const std::size_t four =
            std::size_t{from[at]} + from[at + 1] + from[at + 2 * side] + from[at + 2 * side + 1];
        to[y * side + x] = static_cast<std::uint16_t>((four + 2) / 4);
      }
    }
  }
  // Turn the tile so that the drift does not follow its axes.
  const double turn_rad = std::atan(kDriftSlope) + clouds.drift_from_rad + 0.5 * kPi;
  const glm::dvec2 unit(std::cos(turn_rad), std::sin(turn_rad));
  east_tiles_per_m_ = unit / clouds.period_m();
  north_tiles_per_m_ = glm::dvec2(-unit.y, unit.x) / clouds.period_m();
}

std::shared_ptr<const CloudField> CloudField::shared(const Clouds& clouds) {
  static std::mutex mutex;
  static std::weak_ptr<const CloudField> latest;
  const std::scoped_lock lock(mutex);
  std::shared_ptr<const CloudField> field = latest.lock();
  if (field == nullptr || field->clouds() != clouds) {
    field = std::make_shared<const CloudField>(clouds);
    latest = field;
  }
  return field;
}

std::span<const std::uint16_t> CloudField::level(std::size_t level) const noexcept {
  EMIT_DCHECK_OP(level, <, kLevels);
  const std::size_t side = kSide >> level;
  return std::span(texels_).subspan(first_of(level), side * side);
}

glm::dvec2 CloudField::tiles_of(const glm::dvec2& east_north_m) const noexcept {
  return east_north_m.x * east_tiles_per_m_ + east_north_m.y * north_tiles_per_m_;
}

glm::dvec2 CloudField::tile_at(const glm::dvec2& east_north_m,
                               std::int64_t sim_time_ns) const noexcept {
  const double passed_s = 1e-9 * static_cast<double>(sim_time_ns);
  const glm::dvec2 tile = tiles_of(east_north_m - passed_s * clouds_.velocity_m_s());
  return {wrapped(tile.x), wrapped(tile.y)};
}

double CloudField::bilinear_frac(std::size_t level, const glm::dvec2& tile) const noexcept {
  const std::size_t side = kSide >> level;
  const std::size_t mask = side - 1;
  const double x = wrapped(tile.x) * static_cast<double>(side) - 0.5;
  const double y = wrapped(tile.y) * static_cast<double>(side) - 0.5;
  const double low_x = std::floor(x);
  const double low_y = std::floor(y);
  const auto x0 = static_cast<std::size_t>(low_x + static_cast<double>(side)) & mask;
  const auto y0 = static_cast<std::size_t>(low_y + static_cast<double>(side)) & mask;
  const std::size_t x1 = (x0 + 1) & mask;
  const std::size_t y1 = (y0 + 1) & mask;
  const std::uint16_t* texels = texels_.data() + first_of(level);
  const double low = std::lerp(static_cast<double>(texels[y0 * side + x0]),
                               static_cast<double>(texels[y0 * side + x1]), x - low_x);
  const double high = std::lerp(static_cast<double>(texels[y1 * side + x0]),
                                static_cast<double>(texels[y1 * side + x1]), x - low_x);
  return std::lerp(low, high, y - low_y) / kMostValue;
}

double CloudField::opacity_frac(const glm::dvec2& tile, double width_tiles) const noexcept {
  const double fine = std::clamp(std::log2(std::max(width_tiles * kSide, 1.0)), 0.0,
                                 static_cast<double>(kLevels - 1));
  const auto level = static_cast<std::size_t>(fine);
  const double low = bilinear_frac(level, tile);
  const double part = fine - static_cast<double>(level);
  if (!(part > 0.0)) return low;
  return std::lerp(low, bilinear_frac(level + 1, tile), part);
}

CloudLight CloudField::light(const Forcing& forcing, const SunPosition& sun, const GeoPlace& place,
                             double linke_turbidity) const noexcept {
  const double mean_w_m2 = forcing.direct_normal_w_m2 * (1.0 - forcing.cloud_frac);
  if (!(mean_w_m2 > 0.0) || !(mean_frac_ > 0.0)) return {};
  const double clear_w_m2 =
      clear_sky_irradiance(sun, place.height, linke_turbidity).direct_normal_w_m2;
  const double through_frac = 1.0 - (1.0 - clouds_.transmission_frac) * mean_frac_;
  const double between_w_m2 = std::min(mean_w_m2 / through_frac, std::max(clear_w_m2, mean_w_m2));
  return {between_w_m2 / mean_w_m2, (1.0 - mean_w_m2 / between_w_m2) / mean_frac_};
}

double cloud_range_m(double above_m, double sin_elevation) noexcept {
  const double along_m = kCloudEarthRadiusM * sin_elevation;
  const double square_m2 = above_m * (2.0 * kCloudEarthRadiusM + above_m);
  const double root_m = std::sqrt(along_m * along_m + square_m2);
  // Take the form without cancellation on either side of the horizon.
  return along_m > 0.0 ? square_m2 / (along_m + root_m) : root_m - along_m;
}

glm::dvec2 cloud_crossing_m(double above_m, const glm::dvec3& direction) noexcept {
  return cloud_range_m(above_m, direction.z) * glm::dvec2(direction);
}

}  // namespace emit::physics
