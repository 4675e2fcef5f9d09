// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

#include "emit/physics/frames.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::scene {

struct TrajectoryState {
  physics::Pose pose;
  bool on = true;
};

/// Pose and on state at an instant: interpolated between keyframes, constant outside, no motion
/// towards a keyframe marked teleport. @pre not empty, ascending. RT-safe.
[[nodiscard]] TrajectoryState trajectory_at(const Trajectory& keyframes,
                                            std::int64_t sim_time_ns) noexcept;

}  // namespace emit::scene
