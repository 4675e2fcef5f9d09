// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"

/// Broken clouds: a layer with structure that drifts over the scene (physics.md section 16). One
/// field says where clouds are, for the sun on the ground and for the sky in the picture.
namespace emit::physics {

/// Clouds of a scenario. They lie in one level layer and drift without changing.
struct Clouds {
  double cover_frac = 0.4;         ///< share of the layer that clouds cover, 0..0.95
  double base_m = 1500.0;          ///< height of the layer above the world's origin, > 0
  double transmission_frac = 0.1;  ///< share of the direct sun that passes a cloud, 0..0.95
  double shortest_m = 200.0;       ///< wavelengths between which the field varies
  double longest_m = 3000.0;       ///< at most kMostRatio times the shortest
  double slope = 3.0;              ///< of the power spectral density over the plane
  std::uint64_t seed = 1;          ///< another seed gives other clouds
  double drift_m_s = 0.0;          ///< speed of the layer
  double drift_from_rad = 0.0;     ///< from where it comes, clockwise from north

  static constexpr double kPeriodWaves = 128.0;  ///< shortest wavelengths in a tile of the field
  static constexpr double kMostRatio = 32.0;

  /// Edge of the tile after which the field repeats.
  [[nodiscard]] double period_m() const noexcept { return kPeriodWaves * shortest_m; }
  /// Velocity of the layer, to the east and to the north.
  [[nodiscard]] glm::dvec2 velocity_m_s() const noexcept {
    return {-drift_m_s * std::sin(drift_from_rad), -drift_m_s * std::cos(drift_from_rad)};
  }
  bool operator==(const Clouds&) const = default;
};

/// Direct sun under broken clouds, by the mean over the layer: gain * (1 - depth * opacity).
struct CloudLight {
  double gain = 1.0;   ///< direct sun between the clouds by the mean
  double depth = 0.0;  ///< share of it that a whole cloud takes

  [[nodiscard]] double by_mean(double opacity_frac) const noexcept {
    return gain * (1.0 - depth * opacity_frac);
  }
};

/// Opacity of the layer over a tile that repeats, as a function of simulation time: 1 in a cloud, 0
/// between clouds, with soft edges. Its mean over the tile is the cover.
/// Immutable; any thread; RT-safe but for the constructor.
class CloudField {
 public:
  static constexpr std::size_t kSide = 1024;  ///< texels along the edge of the tile
  static constexpr std::size_t kLevels = 11;  ///< means over 1, 2, 4 .. 1024 texels
  static constexpr double kMostValue = 65535.0;

  /// Makes the field. Setup only: some tenths of a second.
  explicit CloudField(const Clouds& clouds);
  /// Returns the field of these clouds, which all who ask for it at a time share. Setup only; any
  /// thread.
  [[nodiscard]] static std::shared_ptr<const CloudField> shared(const Clouds& clouds);

  [[nodiscard]] const Clouds& clouds() const noexcept { return clouds_; }
  /// Mean opacity of the field, which is the cover to a few parts in 10^5.
  [[nodiscard]] double mean_frac() const noexcept { return mean_frac_; }
  /// Texels of a level, row by row, in steps of 1 / kMostValue. @pre level < kLevels
  [[nodiscard]] std::span<const std::uint16_t> level(std::size_t level) const noexcept;

  /// Returns the place in tiles above a point of the ground, for a layer that has drifted to a
  /// simulation time. Whole tiles are left out: the result lies in 0..1.
  [[nodiscard]] glm::dvec2 tile_at(const glm::dvec2& east_north_m,
                                   std::int64_t sim_time_ns) const noexcept;
  /// Returns the difference in tiles of a difference in metres.
  [[nodiscard]] glm::dvec2 tiles_of(const glm::dvec2& east_north_m) const noexcept;
  /// Returns the opacity at a place in tiles, the mean over about `width_tiles`, 0..1: bilinear in
  /// each of two levels, linear between them.
  [[nodiscard]] double opacity_frac(const glm::dvec2& tile, double width_tiles) const noexcept;

  /// Returns the direct sun under these clouds. The mean is that of the weather. Between the clouds
  /// the sun is at most that of a clear sky; where the weather's mean needs more, clouds let more
  /// through.
  [[nodiscard]] CloudLight light(const Forcing& forcing, const SunPosition& sun,
                                 const GeoPlace& place, double linke_turbidity) const noexcept;

 private:
  [[nodiscard]] double bilinear_frac(std::size_t level, const glm::dvec2& tile) const noexcept;

  Clouds clouds_;
  glm::dvec2 east_tiles_per_m_{0.0};
  glm::dvec2 north_tiles_per_m_{0.0};
  double mean_frac_ = 0.0;
  std::vector<std::uint16_t> texels_;  ///< all levels, the finest first
};

/// Radius of the Earth under the layer.
inline constexpr double kCloudEarthRadiusM = 6371000.0;
/// Returns the way along a ray from a point to a layer that is `above_m` higher at the point, over
/// a round Earth. @pre above_m > 0
[[nodiscard]] double cloud_range_m(double above_m, double sin_elevation) noexcept;
/// Returns where a ray in a direction (unit vector, ENU) meets the layer, as an offset on the
/// ground from the point. @pre above_m > 0
[[nodiscard]] glm::dvec2 cloud_crossing_m(double above_m, const glm::dvec3& direction) noexcept;

}  // namespace emit::physics
