// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

#include "emit/physics/frames.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::scene {

/// Pose and on state at one instant.
struct TrajectoryState {
  physics::Pose pose;
  bool on = true;
};

/// Pose and on state at an instant. They are interpolated between keyframes and constant before the
/// first and after the last one. There is no motion towards a keyframe marked teleport. RT-safe.
/// @pre the trajectory is not empty and ascends in time.
[[nodiscard]] TrajectoryState trajectory_at(const Trajectory& keyframes,
                                            std::int64_t sim_time_ns) noexcept;

}  // namespace emit::scene
