// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <functional>
#include <glm/ext/vector_double3.hpp>
#include <optional>

#include "emit/physics/frames.hpp"
#include "emit/protocol/host_frame.hpp"
#include "engage/guidance.hpp"
#include "engage/missile.hpp"

namespace emit::server {

/// Settings of an engagement.
struct EngagementOptions {
  MissileParameters missile;
  SeekerHead::Limits head;
  double navigation_gain = 4.0;
  double filter_memory_frac = 0.8;
  double integration_step_s = 0.001;
};

/// A missile with a stabilised seeker that flies against a target by proportional navigation. The
/// caller brings the measurements; the object knows the target's true place only to find the
/// closest approach and to point the head before the launch.
///
/// Thread: one owner. RT-safe. The result depends on the calls alone, not on any clock.
class Engagement {
 public:
  /// Place of the point that the missile should hit, in the world, at a time since the launch, s.
  using Target = std::function<glm::dvec3(double time_s)>;

  /// The head points to the target at the launch.
  /// @pre the launch does not take place at the target; the options meet the preconditions of their
  ///   classes
  Engagement(const EngagementOptions& options, const MissileState& launch, Target target);

  /// Returns the pose of the optical axis, and its rates, as host frames carry them.
  [[nodiscard]] physics::Pose seeker_pose() const noexcept;
  [[nodiscard]] protocol::PoseRates seeker_rates() const noexcept;
  /// Takes the direction that the seeker measured in the frame of an instant since the launch;
  /// nothing where it found no target. An instant that is not later than the last one is ignored.
  void measure(double time_s, const std::optional<glm::dvec3>& direction) noexcept;
  /// Flies on by `step_s`, or to shortly behind the closest approach.
  /// @pre step_s > 0
  void advance(double step_s) noexcept;

  /// Returns true behind the closest approach, or when the missile has hit the ground at height 0.
  [[nodiscard]] bool finished() const noexcept { return finished_; }
  [[nodiscard]] bool on_ground() const noexcept { return on_ground_; }
  [[nodiscard]] const Missile& missile() const noexcept { return missile_; }
  [[nodiscard]] const SeekerHead& head() const noexcept { return head_; }
  [[nodiscard]] const LineOfSightFilter& line_of_sight() const noexcept { return filter_; }
  [[nodiscard]] const glm::dvec3& command_m_s2() const noexcept { return command_m_s2_; }
  [[nodiscard]] const ClosestApproach& closest() const noexcept { return closest_; }
  [[nodiscard]] double range_m() const noexcept;
  /// Returns the angle between the optical axis and the true direction to the target.
  [[nodiscard]] double boresight_error_rad() const noexcept;

 private:
  [[nodiscard]] glm::dvec3 to_target_m() const noexcept;

  EngagementOptions options_;
  Target target_;
  Missile missile_;
  SeekerHead head_;
  LineOfSightFilter filter_;
  ClosestApproach closest_;
  glm::dvec3 command_m_s2_{0.0};
  glm::dvec3 head_rate_rad_s_{0.0};  ///< about the axes of the head
  std::optional<double> measured_s_;
  bool finished_ = false;
  bool on_ground_ = false;
};

}  // namespace emit::server
