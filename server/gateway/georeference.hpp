// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/matrix_double3x3.hpp>
#include <glm/ext/quaternion_double.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/gtc/quaternion.hpp>

#include "emit/physics/frames.hpp"
#include "emit/physics/geodesy.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::server {

/// Returns the place of the world's origin. Without a scenario it is where the equator meets the
/// prime meridian.
[[nodiscard]] inline physics::GeoPlace origin_of(const scene::ScenarioDesc* scenario) noexcept {
  if (scenario == nullptr) return {};
  return {physics::Radians(scenario->place.lat_rad), physics::Radians(scenario->place.lon_rad),
          physics::Metres(scenario->place.height_m)};
}

/// Place of the scenario's world on the WGS-84 ellipsoid. The world is the east-north-up frame at
/// its origin, so that its ground does not follow the curvature: 1 km away the ellipsoid is 8 cm
/// below its horizontal plane, 10 km away 8 m.
///
/// Thread: any. Real time: RT-safe.
class Georeference {
 public:
  explicit Georeference(const physics::GeoPlace& origin) noexcept
      : origin_ecef_m_(physics::ecef_m(origin)), ecef_from_world_(physics::ecef_from_enu(origin)) {}

  /// Returns the position of a place in the world, m.
  [[nodiscard]] glm::dvec3 position_world_m(const physics::GeoPlace& place) const noexcept {
    return (physics::ecef_m(place) - origin_ecef_m_) * ecef_from_world_;
  }
  /// Returns the position of a point given in ECEF, m.
  [[nodiscard]] glm::dvec3 world_from_ecef_m(const glm::dvec3& position_ecef_m) const noexcept {
    return (position_ecef_m - origin_ecef_m_) * ecef_from_world_;
  }
  /// Returns the place of a point of the world.
  [[nodiscard]] physics::GeoPlace place_of(const glm::dvec3& position_world_m) const noexcept {
    return physics::place_at_ecef(origin_ecef_m_ + ecef_from_world_ * position_world_m);
  }
  /// Returns the rotation from the east-north-up frame at a place to the world.
  [[nodiscard]] glm::dmat3 world_from_enu(const physics::GeoPlace& place) const noexcept {
    return glm::transpose(ecef_from_world_) * physics::ecef_from_enu(place);
  }
  /// Returns the rotation from ECEF axes to those of the world.
  [[nodiscard]] glm::dmat3 world_from_ecef() const noexcept {
    return glm::transpose(ecef_from_world_);
  }
  /// Returns the pose of a body at a place. Its heading, pitch and roll refer to north, east and
  /// down at that place.
  [[nodiscard]] physics::Pose world_pose(const physics::GeoPlace& place,
                                         const physics::HeadingPitchRoll& attitude) const noexcept {
    return {position_world_m(place),
            glm::normalize(glm::quat_cast(world_from_enu(place)) *
                           physics::world_from_body_heading_pitch_roll(
                               attitude.heading_rad, attitude.pitch_rad, attitude.roll_rad))};
  }
  /// Returns heading, pitch and roll of a body, by north, east and down where it is.
  [[nodiscard]] physics::HeadingPitchRoll attitude_of(const physics::Pose& pose) const noexcept {
    const glm::dmat3 enu_from_world =
        glm::transpose(world_from_enu(place_of(pose.position_world_m)));
    return physics::heading_pitch_roll(
        glm::normalize(glm::quat_cast(enu_from_world) * pose.world_from_body));
  }

 private:
  glm::dvec3 origin_ecef_m_;
  glm::dmat3 ecef_from_world_;
};

}  // namespace emit::server
