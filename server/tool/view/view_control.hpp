// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_uint2.hpp>
#include <optional>

#include "emit/physics/frames.hpp"

namespace emit::tool::view {

/// Motion of camera and clock that the user requests. Streams ignore it.
struct ViewControl {
  double yaw_rad = 0.0;    ///< added to the scenario's heading, clockwise
  double pitch_rad = 0.0;  ///< added to its elevation, up
  bool paused = false;
  bool samples = false;            ///< frames name the pixels that hold a thermal sample
  std::uint8_t quality_level = 0;  ///< a number too high is the last one

  /// The members below are single steps, not a state. The provider consumes them.
  double jump_s = 0.0;                    ///< seconds to add to the simulated time
  double forward_m = 0.0;                 ///< steps along the view's boresight as it is turned now
  double right_m = 0.0;                   ///< to its right
  double up_m = 0.0;                      ///< world
  bool home = false;                      ///< forget earlier steps
  std::optional<glm::uvec2> report_px{};  ///< pixel to explain
};

/// Returns the scenario's attitude after a turn: yaw about the world's vertical, clockwise seen
/// from above, pitch about the body's y axis.
[[nodiscard]] physics::Pose turned_pose(const physics::Pose& base,
                                        const ViewControl& control) noexcept;

/// Returns the control's steps in world metres, taken in the turned attitude.
[[nodiscard]] glm::dvec3 step_world_m(const physics::Pose& base,
                                      const ViewControl& control) noexcept;

}  // namespace emit::tool::view
