// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "emit/physics/check.hpp"
#include "emit/physics/frames.hpp"
#include "emit/protocol/host_frame.hpp"
#include "motion/motion_table.hpp"
#include "motion/point_course.hpp"

namespace emit::server {

/// Pose of the seeker at an instant of simulation time.
struct SeekerPose {
  std::int64_t sim_time_ns = 0;
  physics::Pose seeker;
  std::optional<protocol::PoseRates> rates;
};

/// Motion of the seeker and its target, predicted from the latest poses: with rates as the host
/// gives them, or differenced, and with constant acceleration. The target may come more seldom than
/// the seeker.
///
/// Fixed size. RT-safe.
class SeekerCourse {
 public:
  /// Adds a pose, by the rules of PointCourse::push().
  void push(const SeekerPose& pose) noexcept;
  /// Adds a place of the target.
  void push_target(const TimedPoint& target) noexcept { target_.push(target); }
  /// Forgets the seeker's poses. The target stays.
  void clear_seeker() noexcept {
    count_ = 0;
    position_.clear();
  }
  void clear() noexcept {
    clear_seeker();
    target_.clear();
  }
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  [[nodiscard]] bool has_target() const noexcept { return !target_.empty(); }
  /// @pre !empty()
  [[nodiscard]] std::int64_t newest_ns() const noexcept {
    EMIT_DCHECK(!empty());
    return poses_[count_ - 1].sim_time_ns;
  }
  /// Returns the time between the two newest poses, ns; 0: there are not two.
  [[nodiscard]] std::int64_t interval_ns() const noexcept {
    return count_ < 2 ? 0 : newest_ns() - poses_[count_ - 2].sim_time_ns;
  }

  /// Returns the state at an instant near the newest pose. Without a target, or with one at the
  /// seeker's own place, the target counts as straight ahead.
  /// @pre !empty()
  [[nodiscard]] SeekerState at(std::int64_t sim_time_ns) const noexcept;

 private:
  /// Angular velocity and acceleration at the newest pose, in axes of the seeker.
  struct Turn {
    glm::dvec3 rate_rad_s{0.0};
    glm::dvec3 acceleration_rad_s2{0.0};
  };
  [[nodiscard]] Turn turn() const noexcept;

  std::array<SeekerPose, 3> poses_;  ///< the oldest first
  std::size_t count_ = 0;
  PointCourse position_;  ///< of the seeker
  PointCourse target_;
};

}  // namespace emit::server
