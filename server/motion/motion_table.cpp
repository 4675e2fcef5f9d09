// SPDX-License-Identifier: Apache-2.0
#include "motion/motion_table.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "emit/physics/check.hpp"
#include "emit/physics/frames.hpp"

namespace emit::server {

TableAngles angles_of(const TableMotion& motion) noexcept {
  return {{motion.unit.rings[0].angle_rad, motion.unit.rings[1].angle_rad,
           motion.unit.rings[2].angle_rad},
          {motion.target.azimuth.angle_rad, motion.target.elevation.angle_rad}};
}

TableMotion MotionTable::command(const SeekerState& state, const TableMotion& near) const noexcept {
  TableMotion out;
  const TableAngles near_angles = angles_of(near);
  // Turn the seeker to its attitude: lab_from_seeker = lab_from_base rings payload_from_seeker.
  const glm::dmat3& mount = alignment_.unit_payload_from_seeker;
  const glm::dmat3 base_from_payload = glm::transpose(alignment_.lab_from_unit_base) *
                                       alignment_.lab_from_world * state.world_from_seeker *
                                       glm::transpose(mount);
  out.unit = unit_.motion(base_from_payload, mount * state.angular_velocity_rad_s,
                          mount * state.angular_acceleration_rad_s2, near_angles.unit_rad);
  if (!target_) return out;
  // Turn the line of sight of the projector to the target. A mount that tilts it is taken out where
  // the image is rendered, as far as its field of view reaches.
  const glm::dmat3 base_from_world =
      glm::transpose(alignment_.lab_from_target_base) * alignment_.lab_from_world;
  out.target =
      target_->motion(base_from_world * state.target_m, base_from_world * state.target_velocity_m_s,
                      base_from_world * state.target_acceleration_m_s2, near.target);
  return out;
}

glm::dmat3 MotionTable::seeker_from_projector(const TableAngles& measured) const noexcept {
  const glm::dmat3 lab_from_seeker = alignment_.lab_from_unit_base *
                                     unit_.base_from_payload(measured.unit_rad) *
                                     alignment_.unit_payload_from_seeker;
  const glm::dmat3 rings =
      target_ ? target_->base_from_payload(measured.target_rad.x, measured.target_rad.y)
              : glm::dmat3(1.0);
  const glm::dmat3 lab_from_projector =
      alignment_.lab_from_target_base * rings * alignment_.target_payload_from_projector;
  return glm::transpose(lab_from_seeker) * lab_from_projector;
}

ImageShift image_shift(const glm::dmat3& world_from_rendered, const glm::dmat3& world_from_shown,
                       const glm::dvec2& size_px, double focal_px) noexcept {
  // A direction of the rendered image, in sensor axes, appears at shown_from_rendered times it.
  const glm::dmat3 sensor_from_body = physics::sensor_from_body();
  const glm::dmat3 shown_from_rendered = sensor_from_body * glm::transpose(world_from_shown) *
                                         world_from_rendered * glm::transpose(sensor_from_body);
  const auto moved_px = [&](const glm::dvec2& from_centre_px) {
    const glm::dvec3 at = shown_from_rendered * glm::dvec3(from_centre_px / focal_px, 1.0);
    EMIT_DCHECK_OP(at.z, >, 0.0);
    return glm::dvec2(at) * (focal_px / at.z) - from_centre_px;
  };
  ImageShift out;
  out.shift_px = moved_px({0.0, 0.0});
  for (const glm::dvec2& corner : {glm::dvec2(-0.5, -0.5), glm::dvec2(0.5, -0.5),
                                   glm::dvec2(-0.5, 0.5), glm::dvec2(0.5, 0.5)}) {
    out.residual_px =
        std::max(out.residual_px, glm::length(moved_px(corner * size_px) - out.shift_px));
  }
  return out;
}

}  // namespace emit::server
