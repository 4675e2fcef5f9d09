// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/physics/frames.hpp"
#include "emit/physics/geodesy.hpp"
#include "gnss/truth_trajectory.hpp"

namespace emit::server {

/// Motion on the earth. Position and its derivatives are earth-centred and earth-fixed, so that
/// they hold no rotation of the earth. The attitude is relative to north-east-down at the vehicle's
/// own place. Rates of rotation are about the body axes and against the earth.
struct EarthMotion {
  glm::dvec3 position_ecef_m{0.0};
  glm::dvec3 velocity_ecef_m_s{0.0};
  glm::dvec3 acceleration_ecef_m_s2{0.0};
  glm::dvec3 jerk_ecef_m_s3{0.0};
  physics::GeoPlace place;
  physics::HeadingPitchRoll attitude;
  glm::dvec3 angular_rate_rad_s{0.0};
  glm::dvec3 angular_acceleration_rad_s2{0.0};
  glm::dvec3 angular_jerk_rad_s3{0.0};
};

/// The world frame of a scenario on the earth: a plane that touches the ellipsoid's parallel
/// surface at the scenario's place. Its points rise above that surface by d^2 / 12 742 km at a
/// distance d, as those of any plane do.
/// Thread: any. RT-safe.
class EarthFrame {
 public:
  explicit EarthFrame(const physics::GeoPlace& origin) noexcept;
  [[nodiscard]] EarthMotion motion(const TruthState& state) const noexcept;

 private:
  glm::dvec3 origin_ecef_m_;
  glm::dmat3 ecef_from_world_;
};

}  // namespace emit::server
