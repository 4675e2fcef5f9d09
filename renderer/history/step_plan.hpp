// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "emit/scene/scene_desc.hpp"
#include "history/environment.hpp"
#include "history/pose_history.hpp"

namespace emit::renderer {

/// One interval of the thermal history and the instant whose shadow stands for it.
struct HistoryInterval {
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = 0;
  std::int64_t sample_ns = 0;
  physics::SunPosition sun_begin;
  physics::SunPosition sun_sample;
  physics::SunPosition sun_end;
  physics::Forcing forcing_begin;
  physics::Forcing forcing_end;
  bool sun_up = false;  ///< worth a shadow map
};

/// The intervals from history start to a frame's instant, in order of time. Their number is fixed
/// (thermal.steps); near every event of an entity (appears, vanishes, starts, stops) the closest
/// inner node is moved onto it, so that a parked vehicle's shade begins and ends on time; likewise
/// near every change of the weather by the host.
/// Owner: Renderer. Real time: update is RT-safe.
class StepPlan {
 public:
  explicit StepPlan(const scene::ThermalOptions& options);

  void update(std::int64_t now_ns, const Environment& environment,
              std::span<const PoseHistory> entities) noexcept;

  [[nodiscard]] std::span<const HistoryInterval> intervals() const noexcept { return intervals_; }
  /// Sun at the frame's instant.
  [[nodiscard]] const physics::SunPosition& sun_now() const noexcept { return sun_now_; }
  [[nodiscard]] const physics::Forcing& forcing_now() const noexcept { return forcing_now_; }

  /// Below this elevation the direct sun is negligible and no shadow map is drawn.
  static constexpr double kMinSunElevationRad = 0.5 * physics::kDegree;

 private:
  void snap_to(std::span<const std::int64_t> events_ns) noexcept;

  scene::ThermalOptions options_;
  std::vector<std::int64_t> nodes_ns_;
  std::vector<bool> snapped_;
  std::vector<HistoryInterval> intervals_;
  physics::SunPosition sun_now_;
  physics::Forcing forcing_now_;
};

}  // namespace emit::renderer
