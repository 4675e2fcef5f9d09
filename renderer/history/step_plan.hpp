// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "emit/scene/scene_desc.hpp"
#include "history/environment.hpp"
#include "history/part_history.hpp"
#include "history/pose_history.hpp"

namespace emit::renderer {

/// Interval of the thermal history, with the instant whose shadow represents it.
struct HistoryInterval {
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = 0;
  std::int64_t sample_ns = 0;
  physics::SunPosition sun_begin;
  physics::SunPosition sun_sample;
  physics::SunPosition sun_end;
  physics::Forcing forcing_begin;
  physics::Forcing forcing_end;
  double rain_mm = 0.0;  ///< depth that falls in it
  bool sun_up = false;   ///< true when the sun needs a shadow map
};

/// Intervals from the history's start to a frame's instant, in order of time. Their number is fixed
/// (thermal.steps). The closest inner node moves onto every event of an entity (appears, vanishes,
/// starts, stops), so that a parked vehicle's shade begins and ends on time. The same holds for
/// every change of the weather by the host, and for every command of a part. Owner: Renderer.
/// Thread: the renderer's.  Real time: update is RT-safe.
class StepPlan {
 public:
  explicit StepPlan(const scene::ThermalOptions& options);

  /// Computes the intervals up to `now_ns`.
  void update(std::int64_t now_ns, const Environment& environment,
              std::span<const PoseHistory> entities,
              std::span<const PartHistory> parts = {}) noexcept;

  [[nodiscard]] std::span<const HistoryInterval> intervals() const noexcept { return intervals_; }
  /// Returns the sun and the weather at the frame's instant.
  [[nodiscard]] const physics::SunPosition& sun_now() const noexcept { return sun_now_; }
  [[nodiscard]] const physics::Forcing& forcing_now() const noexcept { return forcing_now_; }

  /// Lowest elevation of the sun that needs a shadow map. The direct sun is negligible below it.
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
