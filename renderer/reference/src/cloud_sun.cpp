// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/cloud_sun.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/clear_sky.hpp"

namespace emit::reference {

CloudSun::CloudSun(const scene::ScenarioDesc& scenario)
    : field_(physics::CloudField::shared(*scenario.clouds)),
      place_{physics::Radians(scenario.place.lat_rad), physics::Radians(scenario.place.lon_rad),
             physics::Metres(scenario.place.height_m)},
      epoch_utc_ns_(scenario.epoch_utc_ns),
      linke_turbidity_(scenario.clear_sky.linke_turbidity) {}

double CloudSun::step_s() const noexcept {
  return 0.25 * clouds().shortest_m / std::max(clouds().drift_m_s, 1e-3);
}

double CloudSun::range_m(double above_m, const glm::dvec3& direction) noexcept {
  // Walk along the ray until it is as far from the middle of the Earth as the layer is. The
  // function bends one way, so that Newton's method from far outside converges.
  const glm::dvec3 start_m(0.0, 0.0, physics::kCloudEarthRadiusM);
  double range_m = 4.0 * std::sqrt(2.0 * physics::kCloudEarthRadiusM * above_m) +
                   4.0 * above_m / std::max(std::abs(direction.z), 0.01);
  for (int i = 0; i < 60; ++i) {
    const glm::dvec3 at_m = start_m + range_m * direction;
    const double radius_m = glm::length(at_m);
    range_m -=
        (radius_m - physics::kCloudEarthRadiusM - above_m) * radius_m / glm::dot(at_m, direction);
  }
  return range_m;
}

double CloudSun::opacity_frac(const glm::dvec3& from_m, const glm::dvec3& direction,
                              std::int64_t sim_time_ns) const noexcept {
  const double above_m = clouds().base_m - from_m.z;
  if (!(above_m > 0.0)) return 0.0;
  const double passed_s = static_cast<double>(sim_time_ns) * 1e-9;
  const glm::dvec2 drift_m = passed_s * clouds().velocity_m_s();
  const glm::dvec2 met_m =
      glm::dvec2(from_m) + range_m(above_m, direction) * glm::dvec2(direction) - drift_m;
  return field_->opacity_frac(field_->tile_at(met_m, 0), 0.0);
}

double CloudSun::by_mean(const glm::dvec3& point_m, const glm::dvec3& to_sun, double mean_w_m2,
                         std::int64_t sim_time_ns) const noexcept {
  if (!(mean_w_m2 > 0.0)) return 1.0;
  const physics::SunPosition sun = physics::sun_position(epoch_utc_ns_ + sim_time_ns, place_);
  const double clear_w_m2 =
      physics::clear_sky_irradiance(sun, place_.height, linke_turbidity_).direct_normal_w_m2;
  const double cover = field_->mean_frac();
  // Between the clouds there is as much sun as their transmission asks for, at most a clear sky's.
  double clouds_w_m2 = 0.0;
  double between_w_m2 = mean_w_m2 / (1.0 - cover + cover * clouds().transmission_frac);
  if (between_w_m2 > std::max(clear_w_m2, mean_w_m2)) {
    between_w_m2 = std::max(clear_w_m2, mean_w_m2);
    clouds_w_m2 = (mean_w_m2 - (1.0 - cover) * between_w_m2) / cover;
  } else {
    clouds_w_m2 = clouds().transmission_frac * between_w_m2;
  }
  const double opacity = opacity_frac(point_m, to_sun, sim_time_ns);
  return std::lerp(between_w_m2, clouds_w_m2, opacity) / mean_w_m2;
}

}  // namespace emit::reference
