// SPDX-License-Identifier: Apache-2.0
#include "gnss/earth_motion.hpp"

#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

namespace emit::server {

EarthFrame::EarthFrame(const physics::GeoPlace& origin) noexcept
    : origin_ecef_m_(physics::ecef_m(origin)), ecef_from_world_(physics::ecef_from_enu(origin)) {}

EarthMotion EarthFrame::motion(const TruthState& state) const noexcept {
  EarthMotion out;
  out.position_ecef_m = origin_ecef_m_ + ecef_from_world_ * state.pose.position_world_m;
  out.velocity_ecef_m_s = ecef_from_world_ * state.velocity_m_s;
  out.acceleration_ecef_m_s2 = ecef_from_world_ * state.acceleration_m_s2;
  out.jerk_ecef_m_s3 = ecef_from_world_ * state.jerk_m_s3;
  out.place = physics::place_at_ecef(out.position_ecef_m);
  const glm::dmat3 local_from_world =
      glm::transpose(physics::ecef_from_enu(out.place)) * ecef_from_world_;
  out.attitude = physics::heading_pitch_roll(
      glm::quat_cast(local_from_world * glm::mat3_cast(state.pose.world_from_body)));
  out.angular_rate_rad_s = state.angular_rate_rad_s;
  out.angular_acceleration_rad_s2 = state.angular_acceleration_rad_s2;
  out.angular_jerk_rad_s3 = state.angular_jerk_rad_s3;
  return out;
}

}  // namespace emit::server
