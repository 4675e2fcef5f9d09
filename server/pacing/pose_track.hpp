// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "emit/physics/check.hpp"
#include "emit/physics/frames.hpp"
#include "emit/protocol/host_frame.hpp"

namespace emit::server {

struct TimedPose {
  std::int64_t sim_time_ns = 0;
  physics::Pose pose;
  std::optional<protocol::PoseRates> rates;
  bool teleport = false;  ///< no motion between the pose before and this one
};

struct PoseSample {
  physics::Pose pose;
  std::int64_t newest_ns = 0;  ///< time stamp of the newest pose known
  std::int64_t shown_ns = 0;   ///< instant the pose stands for: the one asked for, or the clamp
  /// Time stamp of the received pose that this one starts from: the last one at or before shown_ns,
  /// before all of them the oldest. What jumped no later than this has jumped in `pose`.
  std::int64_t base_ns = 0;
  bool extrapolated = false;  ///< shown_ns lies beyond newest_ns
  bool stale = false;         ///< asked for more than the horizon beyond newest_ns
};

/// Recent poses of one body, and where it is at an instant.
///
/// Between received poses: linear in position, shortest arc in attitude. Beyond the newest:
/// p + v t + a t^2 / 2 and a turn by omega t + alpha t^2 / 2. v and omega are as given, else
/// differenced; a and alpha are always differenced. Before the oldest: the oldest. Thread: one
/// owner. Real time: RT-safe.
class PoseTrack {
 public:
  static constexpr std::size_t kHistory = 8;

  void clear() noexcept { count_ = 0; }
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  /// Adds a pose. A pose of the newest instant replaces that one.
  /// @pre the pose is not older than the newest one
  void push(const TimedPose& pose) noexcept;
  /// @pre !empty()
  [[nodiscard]] const TimedPose& newest() const noexcept {
    EMIT_DCHECK(!empty());
    return at(count_ - 1);
  }
  /// Returns the pose at an instant, at most `horizon_ns` beyond the newest one.
  /// @pre !empty() and horizon_ns >= 0
  [[nodiscard]] PoseSample sample(std::int64_t sim_time_ns, std::int64_t horizon_ns) const noexcept;

 private:
  struct Motion {
    glm::dvec3 velocity_m_s{0.0};
    glm::dvec3 acceleration_m_s2{0.0};
    glm::dvec3 angular_rate_body_rad_s{0.0};
    glm::dvec3 angular_acceleration_body_rad_s2{0.0};
  };
  /// index 0 = oldest.
  [[nodiscard]] const TimedPose& at(std::size_t index) const noexcept {
    return poses_[(first_ + index) % kHistory];
  }
  [[nodiscard]] Motion motion_at_newest() const noexcept;

  std::array<TimedPose, kHistory> poses_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
};

}  // namespace emit::server
