// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"
#include "engage/engagement.hpp"
#include "tool/engage/flight_host.hpp"

namespace emit::tool {

/// Launch and target of the scripted missile.
struct ScriptedFlight {
  std::uint32_t target_entity = 1;
  glm::dvec3 aim_body_m{0.0};  ///< point of the target: forward, right, down
  double speed_m_s = 260.0;
  double heading_error_rad = 0.0;  ///< of the velocity at the launch, to the right of the target
  server::EngagementOptions engagement;
};

/// The scripted missile. It starts at the scenario's sensor.
class ScriptedHost final : public FlightHost {
 public:
  /// Errors: config (the sensor has no position, the target has no trajectory, the launch is at the
  /// target).
  [[nodiscard]] static physics::Result<std::unique_ptr<ScriptedHost>> create(
      const scene::ScenarioDesc& scenario, std::int64_t start_ns, const ScriptedFlight& flight);

  [[nodiscard]] std::string name() const override { return "scripted missile"; }
  [[nodiscard]] bool guided() const noexcept override { return true; }
  [[nodiscard]] double time_s() const noexcept override {
    return engagement_.missile().state().time_s;
  }
  [[nodiscard]] physics::Pose seeker_pose() const noexcept override {
    return engagement_.seeker_pose();
  }
  [[nodiscard]] std::optional<protocol::PoseRates> seeker_rates() const noexcept override {
    return engagement_.seeker_rates();
  }
  [[nodiscard]] FlightTruth truth() const noexcept override;
  [[nodiscard]] std::optional<glm::dvec3> target_m(double time_s) const noexcept override {
    return target_(time_s);
  }
  void measure(double time_s, const std::optional<glm::dvec3>& direction) noexcept override {
    engagement_.measure(time_s, direction);
  }
  [[nodiscard]] physics::Result<bool> advance(double step_s) override;

  [[nodiscard]] const server::Engagement& engagement() const noexcept { return engagement_; }

 private:
  ScriptedHost(const server::EngagementOptions& options, const server::MissileState& launch,
               server::Engagement::Target target)
      : target_(std::move(target)), engagement_(options, launch, target_) {}
  server::Engagement::Target target_;
  server::Engagement engagement_;
};

}  // namespace emit::tool
