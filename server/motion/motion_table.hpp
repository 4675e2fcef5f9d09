// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <glm/ext/matrix_double3x3.hpp>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <optional>

#include "emit/physics/error.hpp"
#include "motion/gimbal.hpp"

namespace emit::server {

/// Constant rotations between the parts of a flight motion simulator, as measured at its
/// installation. Seeker and projector have body axes: x along the line of sight, y right, z down.
struct TableAlignment {
  /// World is east-north-up, lab is forward-right-down. By default the lab faces north.
  glm::dmat3 lab_from_world{0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0};
  glm::dmat3 lab_from_unit_base{1.0};        ///< base of the rings of the unit under test
  glm::dmat3 unit_payload_from_seeker{1.0};  ///< mount of the seeker in the innermost ring
  glm::dmat3 lab_from_target_base{1.0};      ///< base of the target rings, or of a fixed projector
  glm::dmat3 target_payload_from_projector{1.0};  ///< mount of the projector in the inner ring
};

/// Angles of all axes. `target_rad` are azimuth and elevation, zero without target rings.
struct TableAngles {
  glm::dvec3 unit_rad{0.0};  ///< rings of the unit under test, the outermost first
  glm::dvec2 target_rad{0.0};
};

/// Motion of all axes that shows a target to a seeker.
struct TableMotion {
  ThreeAxisGimbal::Motion unit;
  TwoAxisGimbal::Motion target;
};

/// Attitude of the seeker and the way to its target, as the flight simulation has them.
struct SeekerState {
  glm::dmat3 world_from_seeker{1.0};
  glm::dvec3 angular_velocity_rad_s{0.0};       ///< in axes of the seeker
  glm::dvec3 angular_acceleration_rad_s2{0.0};  ///< in axes of the seeker
  glm::dvec3 target_m{1.0, 0.0, 0.0};           ///< from seeker to target, world axes
  glm::dvec3 target_velocity_m_s{0.0};          ///< derivative of target_m
  glm::dvec3 target_acceleration_m_s2{0.0};     ///< second derivative of target_m
};

/// Flight motion simulator of five axes: three turn the seeker, two turn the target or the infrared
/// projector about it. A table of three axes has no target rings, and its projector is fixed.
///
/// The table turns the real seeker. A projected image therefore must not be turned by the seeker's
/// attitude again: it is rendered in the frame of the projector. world_from_projector() also takes
/// out what the axes lag behind, because the seeker sees the projector where the axes really are.
///
/// Immutable. RT-safe.
class MotionTable {
 public:
  MotionTable(const ThreeAxisGimbal& unit, const std::optional<TwoAxisGimbal>& target,
              const TableAlignment& alignment) noexcept
      : unit_(unit), target_(target), alignment_(alignment) {}

  /// Returns the motion of the axes for a state of the seeker. Of the angles that show it, those
  /// nearest to `near` are taken, as ThreeAxisGimbal and TwoAxisGimbal say.
  /// @pre state.target_m is not zero
  [[nodiscard]] TableMotion command(const SeekerState& state,
                                    const TableMotion& near) const noexcept;

  /// Returns the rotation between the real seeker and the real projector.
  [[nodiscard]] glm::dmat3 seeker_from_projector(const TableAngles& measured) const noexcept;

  /// Returns the attitude in which a projected image is rendered, so that a seeker on axes that are
  /// at `measured` sees each thing where one with the attitude `world_from_seeker` would.
  [[nodiscard]] glm::dmat3 world_from_projector(const glm::dmat3& world_from_seeker,
                                                const TableAngles& measured) const noexcept {
    return world_from_seeker * seeker_from_projector(measured);
  }

 private:
  ThreeAxisGimbal unit_;
  std::optional<TwoAxisGimbal> target_;
  TableAlignment alignment_;
};

/// Returns the angles of a motion.
[[nodiscard]] TableAngles angles_of(const TableMotion& motion) noexcept;

/// Attitudes of a frame: that of the seeker which it is for, and that in which it is rendered.
struct ShownAttitude {
  glm::dmat3 world_from_seeker{1.0};
  glm::dmat3 world_from_rendered{1.0};
};

/// Shift of a finished image that turns it from the attitude in which it was rendered to the one in
/// which it is shown.
struct ImageShift {
  glm::dvec2 shift_px{0.0};  ///< by which every pixel moves, right and down
  /// Greatest error that a shift leaves in the image, in the corners: it cannot turn the image
  /// about the line of sight nor stretch it.
  double residual_px = 0.0;
};

/// Returns the shift for an image of `size_px` pixels. `focal_px` is the focal length in pixels.
/// Both attitudes have body axes.
/// @pre the corners of the rendered image lie before the camera that shows it
[[nodiscard]] ImageShift image_shift(const glm::dmat3& world_from_rendered,
                                     const glm::dmat3& world_from_shown, const glm::dvec2& size_px,
                                     double focal_px) noexcept;

}  // namespace emit::server
