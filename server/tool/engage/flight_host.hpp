// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <string>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/protocol/host_frame.hpp"

namespace emit::tool {

/// State of a flight at an instant as its host knows it, for the report.
struct FlightTruth {
  glm::dvec3 velocity_m_s{0.0};
  // The members below hold for hosts that fly against a target.
  double range_m = 0.0;
  double boresight_error_rad = 0.0;  ///< optical axis against the direction to the target
  double command_m_s2 = 0.0;
  double lift_m_s2 = 0.0;
  double angle_of_attack_rad = 0.0;
  double line_of_sight_rate_rad_s = 0.0;
};

/// The simulation of a flight, which the closed loop steps. Single thread.
class FlightHost {
 public:
  virtual ~FlightHost() = default;
  FlightHost() = default;
  FlightHost(const FlightHost&) = delete;
  FlightHost& operator=(const FlightHost&) = delete;

  [[nodiscard]] virtual std::string name() const = 0;
  /// Returns true if the host flies against a target, by the measurements.
  [[nodiscard]] virtual bool guided() const noexcept = 0;
  /// Returns the time since the begin of the flight, s.
  [[nodiscard]] virtual double time_s() const noexcept = 0;
  /// Returns the pose of the seeker now.
  [[nodiscard]] virtual physics::Pose seeker_pose() const noexcept = 0;
  [[nodiscard]] virtual std::optional<protocol::PoseRates> seeker_rates() const noexcept = 0;
  [[nodiscard]] virtual FlightTruth truth() const noexcept = 0;
  /// Returns the true place of the target at a time of the flight; nothing without a target.
  [[nodiscard]] virtual std::optional<glm::dvec3> target_m(double time_s) const noexcept = 0;
  /// Takes a direction that the seeker measured in the world; nothing where it found no target.
  virtual void measure(double time_s, const std::optional<glm::dvec3>& direction) noexcept = 0;
  /// Flies on. Returns false when the flight has ended. Errors: io, protocol (an outside host).
  [[nodiscard]] virtual physics::Result<bool> advance(double step_s) = 0;
};

}  // namespace emit::tool
