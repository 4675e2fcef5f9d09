// SPDX-License-Identifier: Apache-2.0
#include "sky_discs.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

#include "emit/physics/constants.hpp"
#include "emit/physics/frames.hpp"

namespace emit::reference {

double SkyDiscs::radiance_w_m2_sr(const BandRadiance& band, const SolveView& view,
                                  std::size_t pixel) const {
  const double focal_px = 0.5 * view.width_px / std::tan(0.5 * view.fov_h_rad);
  const glm::dmat3 world_from_sensor = glm::mat3_cast(view.sensor_pose.world_from_body) *
                                       glm::transpose(physics::sensor_from_body());
  const auto ray = [&](double x, double y) {
    return world_from_sensor *
           glm::normalize(glm::dvec3((x - 0.5 * view.width_px) / focal_px,
                                     (y - 0.5 * view.height_px) / focal_px, 1.0));
  };
  const auto column = static_cast<double>(pixel % view.width_px);
  const auto row = static_cast<double>(pixel / view.width_px);
  // Leave pixels that are nowhere near a disc, and discs below the horizon.
  const glm::dvec3 middle = ray(column + 0.5, row + 0.5);
  const double sun_rad = std::asin(std::sin(physics::kSunSemiAngleRad) / sun.distance_au);
  const double moon_rad = std::asin(physics::kMoonRadiusM / moon.distance_m);
  const auto near = [&](const glm::dvec3& towards, double radius_rad) {
    return towards.z > 0.0 &&
           glm::dot(middle, towards) > std::cos(std::min(radius_rad + 2.0 / focal_px, 1.5));
  };
  const bool near_sun = near(sun.direction_enu, sun_rad);
  const bool near_moon = near(moon.direction_enu, moon_rad);
  if (!near_sun && !near_moon) return 0.0;

  constexpr int kSide = 16;
  const glm::dvec3& eye_m = view.sensor_pose.position_world_m;
  const double sensor_m = eye_m.z;
  const CloudSun* const clouds = climate->clouds();
  const bool below = clouds != nullptr && sensor_m < clouds->clouds().base_m;
  double sum = 0.0;
  for (int i = 0; i < kSide * kSide; ++i) {
    const glm::dvec3 d = ray(column + (i % kSide + 0.5) / kSide, row + (i / kSide + 0.5) / kSide);
    // Intersect the ball of the moon.
    const double along_m = moon.distance_m * glm::dot(d, moon.direction_enu);
    const double miss_m2 = moon.distance_m * moon.distance_m - along_m * along_m;
    const double deep_m2 = physics::kMoonRadiusM * physics::kMoonRadiusM - miss_m2;
    if (near_moon && along_m > 0.0 && deep_m2 > 0.0) {
      const glm::dvec3 normal =
          ((along_m - std::sqrt(deep_m2)) * d - moon.distance_m * moon.direction_enu) /
          physics::kMoonRadiusM;
      const double cosine = std::max(glm::dot(normal, moon.to_sun_enu), 0.0);
      const double kelvin =
          std::max(physics::kMoonSubsolarK * std::sqrt(std::sqrt(cosine) / moon.sun_au), 100.0);
      const double open_frac = below ? 1.0 - clouds->opacity_frac(eye_m, d, view.sim_time_ns) : 1.0;
      sum += open_frac * band.moon(kelvin, cosine, moon.sun_au, sensor_m, d.z);
    } else if (near_sun && glm::dot(d, sun.direction_enu) > std::cos(sun_rad)) {
      const double cloud_sun =
          below ? clouds->by_mean(eye_m, d, now.direct_normal_w_m2, view.sim_time_ns) : 1.0;
      sum += band.sun_disc(cloud_sun * beam_frac, sensor_m, d.z);
    }
  }
  return sum / (kSide * kSide);
}

}  // namespace emit::reference
