// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_double3.hpp>
#include <optional>

/// Guidance of a missile from directions that its seeker measures. Directions are unit vectors in
/// the world frame. Thread: one owner. RT-safe.
namespace emit::server {

/// Fading-memory filter of second order for the line of sight and its rate (Zarchan, Tactical and
/// Strategic Missile Guidance, chapter 7). A measurement `memory^n` frames old has the weight
/// memory^n. The gains are G = 1 - memory^2 for the direction and H = (1 - memory)^2 per step for
/// the rate.
class LineOfSightFilter {
 public:
  /// @pre 0 <= memory_frac < 1
  explicit LineOfSightFilter(double memory_frac) noexcept;

  /// Takes a measured direction; nothing where the seeker found no target, so that the direction
  /// turns on with its rate. Instants ascend.
  void update(double time_s, const std::optional<glm::dvec3>& direction) noexcept;
  /// Returns true once a direction was measured.
  [[nodiscard]] bool ready() const noexcept { return ready_; }
  /// Returns the direction at an instant near the latest update.
  /// @pre ready()
  [[nodiscard]] glm::dvec3 direction_at(double time_s) const noexcept;
  /// Returns the angular velocity of the line of sight, rad/s, perpendicular to it.
  [[nodiscard]] const glm::dvec3& rate_rad_s() const noexcept { return rate_rad_s_; }

 private:
  double memory_frac_;
  bool ready_ = false;
  double time_s_ = 0.0;
  glm::dvec3 direction_{1.0, 0.0, 0.0};
  glm::dvec3 rate_rad_s_{0.0};
};

/// Returns the command of pure proportional navigation, N w x v, with the part of gravity that is
/// perpendicular to the velocity taken off. It needs no range: v is the missile's own velocity.
/// @param rate_rad_s  angular velocity of the line of sight
/// @pre the velocity is not 0
[[nodiscard]] glm::dvec3 proportional_navigation_m_s2(double gain, const glm::dvec3& rate_rad_s,
                                                      const glm::dvec3& velocity_m_s,
                                                      double gravity_m_s2) noexcept;

/// The stabilised head of a seeker, which turns its optical axis towards a direction.
class SeekerHead {
 public:
  struct Limits {
    double lag_s = 0.02;  ///< time constant of the tracking loop
    double max_rate_rad_s = 1.0;
    double max_look_rad = 0.7;  ///< largest angle between the optical axis and the body's x axis
  };
  /// @pre lag_s > 0; max_rate_rad_s > 0; 0 < max_look_rad < pi; the axis has length 1
  SeekerHead(const Limits& limits, const glm::dvec3& axis) noexcept;

  /// Turns for `step_s` towards `direction`. The travel keeps the axis near the body's.
  void step(const glm::dvec3& direction, const glm::dvec3& body_axis, double step_s) noexcept;
  [[nodiscard]] const glm::dvec3& axis() const noexcept { return axis_; }
  /// Returns true when the latest step met the limit of the travel.
  [[nodiscard]] bool at_limit() const noexcept { return at_limit_; }

 private:
  Limits limits_;
  glm::dvec3 axis_;
  bool at_limit_ = false;
};

/// Nearest distance of two bodies that move in steps. Within a step the motion is taken as linear,
/// so that the point of closest approach lies between the steps.
class ClosestApproach {
 public:
  /// Takes the position of the target as seen from the missile. Instants ascend.
  void add(double time_s, const glm::dvec3& target_from_missile_m) noexcept;
  /// Returns true once the latest step ended farther away than it came.
  [[nodiscard]] bool passed() const noexcept { return passed_; }
  [[nodiscard]] double distance_m() const noexcept;
  [[nodiscard]] double time_s() const noexcept { return nearest_time_s_; }
  [[nodiscard]] const glm::dvec3& offset_m() const noexcept { return nearest_m_; }

 private:
  bool started_ = false;
  bool passed_ = false;
  double last_time_s_ = 0.0;
  glm::dvec3 last_m_{0.0};
  double nearest_time_s_ = 0.0;
  glm::dvec3 nearest_m_{0.0};
};

}  // namespace emit::server
