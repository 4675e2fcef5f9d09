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

namespace emit::server {

/// Pose of the seeker and place of its target at an instant of simulation time.
struct SeekerPose {
  std::int64_t sim_time_ns = 0;
  physics::Pose seeker;
  std::optional<protocol::PoseRates> seeker_rates;
  glm::dvec3 target_m{0.0};  ///< world
  std::optional<glm::dvec3> target_velocity_m_s;
};

/// Motion of the seeker and its target, predicted from the latest poses: with rates as the host
/// gives them, or differenced, and with constant acceleration.
///
/// Fixed size. RT-safe.
class SeekerCourse {
 public:
  /// Adds a pose. One of the newest instant replaces that one, and one that is older is dropped.
  void push(const SeekerPose& pose) noexcept;
  void clear() noexcept { count_ = 0; }
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  /// @pre !empty()
  [[nodiscard]] std::int64_t newest_ns() const noexcept {
    EMIT_DCHECK(!empty());
    return poses_[count_ - 1].sim_time_ns;
  }
  /// Returns the time between the two newest poses, ns; 0: there are not two.
  [[nodiscard]] std::int64_t interval_ns() const noexcept {
    return count_ < 2 ? 0 : newest_ns() - poses_[count_ - 2].sim_time_ns;
  }

  /// Returns the state at an instant near the newest pose. A target at the seeker's own place
  /// counts as one straight ahead.
  /// @pre !empty()
  [[nodiscard]] SeekerState at(std::int64_t sim_time_ns) const noexcept;

 private:
  /// Rates and accelerations at the newest pose.
  struct Rates {
    glm::dvec3 turn_rad_s{0.0};
    glm::dvec3 turn_acceleration_rad_s2{0.0};
    glm::dvec3 target_velocity_m_s{0.0};
    glm::dvec3 target_acceleration_m_s2{0.0};
  };
  [[nodiscard]] Rates rates() const noexcept;

  std::array<SeekerPose, 3> poses_;  ///< the oldest first
  std::size_t count_ = 0;
};

}  // namespace emit::server
