// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <memory>

#include "emit/physics/sky/cloud_field.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::reference {

/// Broken clouds at points and instants. It shares the texels of the field with the renderer and
/// nothing else: no mean over intervals, and its own way from a point to the layer.
/// Immutable; any thread.
class CloudSun {
 public:
  /// Makes the clouds of a scenario. @pre scenario.clouds
  explicit CloudSun(const scene::ScenarioDesc& scenario);

  /// Returns the way along a ray in a direction (unit vector) to a layer that is `above_m` higher
  /// than its start. @pre above_m > 0
  [[nodiscard]] static double range_m(double above_m, const glm::dvec3& direction) noexcept;
  /// Returns the opacity of the layer where a ray from a point meets it; 0 where it does not. The
  /// direction is a unit vector; coordinates are those of the world.
  [[nodiscard]] double opacity_frac(const glm::dvec3& from_m, const glm::dvec3& direction,
                                    std::int64_t sim_time_ns) const noexcept;
  /// Returns the direct sun at a point by the mean of the weather. `mean_w_m2` is that mean, across
  /// the direction to the sun. `to_sun` is the unit vector to the sun.
  [[nodiscard]] double by_mean(const glm::dvec3& point_m, const glm::dvec3& to_sun,
                               double mean_w_m2, std::int64_t sim_time_ns) const noexcept;

  [[nodiscard]] const physics::Clouds& clouds() const noexcept { return field_->clouds(); }
  /// Returns the longest time, s, between instants that miss no cloud: a quarter of the time in
  /// which the shortest wave passes.
  [[nodiscard]] double step_s() const noexcept;

 private:
  std::shared_ptr<const physics::CloudField> field_;
  physics::GeoPlace place_;
  std::int64_t epoch_utc_ns_ = 0;
  double linke_turbidity_ = 0.0;
};

}  // namespace emit::reference
