// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "emit/physics/error.hpp"
#include "motion/axis_profile.hpp"

namespace emit::server {

/// Properties of a simulated axis: a servo of second order with delay, limits and an encoder.
struct AxisDynamics {
  AxisLimits limits;
  double natural_rad_s = 125.7;  ///< natural frequency of the closed loop: 20 Hz
  double damping = 0.7;          ///< damping ratio of the closed loop
  double delay_s = 0.0;          ///< from a command to its effect
  double noise_rad = 0.0;        ///< standard deviation of the measured angle
  double resolution_rad = 0.0;   ///< step of the encoder; 0: none
};

/// Fault of a simulated axis.
enum class AxisFault : std::uint8_t {
  none,
  stuck,    ///< the motor is off; friction stops the axis
  runaway,  ///< the axis moves to the end of its travel at full acceleration
};

/// An axis of a motion simulator, simulated: angle'' = w^2 (command - angle) + 2 d w (command' -
/// angle') + command'', as far as acceleration, rate and travel allow. The end of the travel stops
/// it at once.
///
/// RT-safe after create().
class AxisModel {
 public:
  /// Longest delay in steps of the caller.
  static constexpr std::size_t kMaxDelaySteps = 255;

  /// Errors: invalid_argument (limits that AxisProfile refuses, a frequency that is not positive or
  /// above 1e5 rad/s, a damping that is not positive or above 10, a delay of more than
  /// kMaxDelaySteps steps, or a negative noise or resolution).
  [[nodiscard]] static physics::Result<AxisModel> create(const AxisDynamics& dynamics,
                                                         double step_s, std::uint64_t seed);

  /// Places the axis at rest.
  void start(double angle_rad) noexcept;
  void set_fault(AxisFault fault) noexcept { fault_ = fault; }
  /// Switches the motor on or off. Friction alone acts on an axis that is off, whatever its fault.
  void set_powered(bool powered) noexcept { powered_ = powered; }

  /// Moves on by one step with a command for its end, and returns the true motion.
  const AxisMotion& step(const AxisMotion& command) noexcept;

  [[nodiscard]] const AxisMotion& motion() const noexcept { return motion_; }
  /// Returns the motion as the encoder measures it: the angle with noise, in steps of the encoder.
  [[nodiscard]] AxisMotion measure() noexcept;

 private:
  AxisModel(const AxisDynamics& dynamics, double step_s, std::size_t delay_steps,
            std::uint64_t seed) noexcept
      : dynamics_(dynamics), step_s_(step_s), delay_steps_(delay_steps), random_(seed) {}
  /// Returns the acceleration that the servo and its limits give.
  [[nodiscard]] double acceleration(const AxisMotion& command, double angle_rad,
                                    double rate_rad_s) const noexcept;
  /// Returns a normally distributed number of variance 1.
  [[nodiscard]] double normal() noexcept;

  AxisDynamics dynamics_;
  double step_s_;
  std::size_t delay_steps_;
  std::uint64_t random_;  ///< state of the generator of the noise
  AxisFault fault_ = AxisFault::none;
  bool powered_ = true;
  AxisMotion motion_;
  AxisMotion in_effect_;  ///< command of the step before, after the delay
  std::array<AxisMotion, kMaxDelaySteps + 1> commands_{};
  std::size_t next_ = 0;
};

}  // namespace emit::server
