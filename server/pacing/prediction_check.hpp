// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "pacing/pose_track.hpp"

namespace emit::server {

struct PredictionError {
  double position_m = 0.0;
  double attitude_rad = 0.0;
};

/// Distance of two poses: of their places, and the angle that turns one attitude into the other.
[[nodiscard]] inline PredictionError pose_difference(const physics::Pose& a,
                                                     const physics::Pose& b) noexcept {
  const glm::dquat turn = glm::conjugate(a.world_from_body) * b.world_from_body;
  return {glm::distance(a.position_world_m, b.position_world_m),
          2.0 * std::atan2(glm::length(glm::dvec3{turn.x, turn.y, turn.z}), std::abs(turn.w))};
}

/// Keeps predicted poses until the truth for their instant has come. Pure. RT-safe.
class PredictionCheck {
 public:
  /// Predictions kept; when more wait for the truth, the oldest are forgotten.
  static constexpr std::size_t kKept = 64;

  void clear() noexcept {
    count_ = 0;
    measured_ = 0;
    latest_ = {};
  }
  /// Instants ascend from call to call; the same one again is no new prediction.
  void predicted(std::int64_t sim_time_ns, const physics::Pose& pose) noexcept {
    if (count_ > 0 && at(count_ - 1).sim_time_ns == sim_time_ns) return;
    if (count_ == kKept) {
      first_ = (first_ + 1) % kKept;
      --count_;
    }
    at(count_++) = {sim_time_ns, pose};
  }
  /// `truth` has got a new newest pose: calls `measured(PredictionError)` for every prediction up
  /// to its instant. Between two true poses the truth is what PoseTrack makes of them.
  template <class Measured>
  void compare(const PoseTrack& truth, Measured measured) noexcept {
    while (count_ > 0 && at(0).sim_time_ns <= truth.newest().sim_time_ns) {
      const Kept& kept = at(0);
      latest_ = pose_difference(kept.pose, truth.sample(kept.sim_time_ns, 0).pose);
      first_ = (first_ + 1) % kKept;
      --count_;
      ++measured_;
      measured(latest_);
    }
  }

  [[nodiscard]] const PredictionError& latest() const noexcept { return latest_; }
  /// Since clear().
  [[nodiscard]] std::uint32_t measured() const noexcept { return measured_; }

 private:
  struct Kept {
    std::int64_t sim_time_ns = 0;
    physics::Pose pose;
  };
  [[nodiscard]] Kept& at(std::size_t index) noexcept { return kept_[(first_ + index) % kKept]; }

  std::array<Kept, kKept> kept_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  std::uint32_t measured_ = 0;
  PredictionError latest_;
};

}  // namespace emit::server
