// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/protocol/host_frame.hpp"

namespace emit::server {

/// Pose of the seeker as a log gives it.
struct TruthPose {
  std::int64_t sim_time_ns = 0;
  physics::Pose pose;
  std::optional<protocol::PoseRates> rates;
};

/// Limits of what counts as one continuous motion.
struct TruthLimits {
  double max_gap_s = 1.0;   ///< longest time between two poses
  double max_jump_m = 1.0;  ///< farthest that a pose lies from where the motion leads
};

/// Motion of the seeker at an instant. Vectors are in the world frame, those of rotation about the
/// body axes. The rates of rotation are those against the earth.
struct TruthState {
  physics::Pose pose;
  glm::dvec3 velocity_m_s{0.0};
  glm::dvec3 acceleration_m_s2{0.0};
  glm::dvec3 jerk_m_s3{0.0};
  glm::dvec3 angular_rate_rad_s{0.0};
  glm::dvec3 angular_acceleration_rad_s2{0.0};
  glm::dvec3 angular_jerk_rad_s3{0.0};
};

/// Motion through the poses of a log (docs of the command: deploy/docs/gnss.md).
///
/// The position passes through every pose, on a polynomial of fifth degree between two. Velocity,
/// acceleration and jerk are those of a local fit: a polynomial of fourth degree through the
/// velocities of the log, or of fifth degree through its positions. The attitude passes through
/// every pose as well, and the rates of rotation are fitted to those of the log, or to the mean
/// rates between poses. A fit takes the poses within 50 ms, and at least seven.
///
/// Thread: any, after it was made. Real time: not RT-safe.
class TruthTrajectory {
 public:
  /// Takes the poses of a log in its order. A pose that stands twice in a row is used once. Errors
  /// (invalid_argument) name the poses and their instants: fewer than two poses; a time that goes
  /// back; two poses at one instant; a gap or a jump beyond the limits.
  [[nodiscard]] static physics::Result<TruthTrajectory> create(std::vector<TruthPose> poses,
                                                               const TruthLimits& limits = {});

  [[nodiscard]] std::int64_t first_ns() const noexcept { return poses_.front().sim_time_ns; }
  [[nodiscard]] std::int64_t last_ns() const noexcept { return poses_.back().sim_time_ns; }
  [[nodiscard]] std::size_t size() const noexcept { return poses_.size(); }
  /// Returns whether velocities and rates are the log's, which is so when every pose has them.
  [[nodiscard]] bool has_rates() const noexcept { return has_rates_; }

  /// Returns the motion at an instant.
  /// @pre first_ns() <= sim_time_ns <= last_ns()
  [[nodiscard]] TruthState at(std::int64_t sim_time_ns) const;

 private:
  explicit TruthTrajectory(std::vector<TruthPose> poses);

  /// First and last pose that a fit at an instant takes.
  [[nodiscard]] std::pair<std::size_t, std::size_t> window(std::int64_t sim_time_ns) const noexcept;
  /// Velocity, acceleration and jerk at an instant.
  struct Motion {
    glm::dvec3 first{0.0};
    glm::dvec3 second{0.0};
    glm::dvec3 third{0.0};
  };
  [[nodiscard]] Motion translation(std::int64_t sim_time_ns) const;
  [[nodiscard]] Motion rotation(std::int64_t sim_time_ns) const;
  [[nodiscard]] glm::dvec3 position(std::size_t before, std::int64_t sim_time_ns) const;
  [[nodiscard]] glm::dquat attitude(std::size_t before, std::int64_t sim_time_ns) const;

  std::vector<TruthPose> poses_;
  bool has_rates_ = false;
};

}  // namespace emit::server
