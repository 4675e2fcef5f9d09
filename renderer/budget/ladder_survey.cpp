// SPDX-License-Identifier: Apache-2.0
#include "budget/ladder_survey.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <vector>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "emit/scene/trajectory.hpp"

namespace emit::renderer {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Number of positions along the trajectory that are measured.
constexpr int kPlaces = 12;
/// Number of directions that are measured for a camera without a trajectory.
constexpr int kDirections = 4;

/// Frame that is measured.
struct Place {
  FrameRequest request;
  bool on_trajectory = true;  ///< false: the camera is turned to a direction outside the scenario
};

/// Frames to measure: positions along the rest of the trajectory, or directions without one.
std::vector<Place> places(const scene::SensorDesc& sensor, const FrameRequest& first) {
  std::vector<Place> out{{first}};
  if (sensor.trajectory.size() < 2) {
    for (int i = 1; i < kDirections; ++i) {
      FrameRequest next = first;
      const double yaw_rad = 2.0 * physics::kPi * i / kDirections;
      next.sensor_pose.world_from_body =
          glm::angleAxis(yaw_rad, glm::dvec3(0.0, 0.0, 1.0)) * first.sensor_pose.world_from_body;
      out.push_back({next, false});
    }
    return out;
  }
  const std::int64_t end_ns = sensor.trajectory[sensor.trajectory.size() - 1].sim_time_ns;
  for (int i = 1; i < kPlaces && first.sim_time_ns < end_ns; ++i) {
    // Keep the thermal instant, so that the surface is not advanced between the frames.
    FrameRequest next = first;
    const double way = static_cast<double>(i) / (kPlaces - 1);
    next.sim_time_ns += std::llround(way * static_cast<double>(end_ns - first.sim_time_ns));
    next.sensor_pose = trajectory_at(sensor.trajectory, next.sim_time_ns).pose;
    out.push_back({next});
  }
  return out;
}

/// Frame that is rendered and timed on construction. It occupies a slot of the renderer until it is
/// destroyed.
class Taken {
 public:
  Taken(Renderer& renderer, const FrameRequest& request) : renderer_(renderer) {
    using Clock = std::chrono::steady_clock;
    const auto start = Clock::now();
    slot_ = renderer.submit(request);
    if (slot_ < 0) return;
    view_ = &renderer.collect(static_cast<SlotIndex>(slot_));
    frame_ms_ = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  }
  ~Taken() {
    if (slot_ >= 0) renderer_.release(static_cast<SlotIndex>(slot_));
  }
  Taken(const Taken&) = delete;
  Taken& operator=(const Taken&) = delete;

  [[nodiscard]] bool good() const noexcept { return view_ != nullptr && !view_->device_failed; }
  [[nodiscard]] const FrameView& view() const noexcept { return *view_; }
  [[nodiscard]] double frame_ms() const noexcept { return frame_ms_; }

 private:
  Renderer& renderer_;
  int slot_ = -1;
  const FrameView* view_ = nullptr;
  double frame_ms_ = 0.0;
};

/// Largest RMS difference of the apparent temperature over the bands, K.
double difference_k(const FrameView& full, const FrameView& shed,
                    std::span<const physics::ApparentTemperature> apparent) {
  EMIT_CHECK_OP(apparent.size(), ==, full.radiance_w_m2_sr.size());
  double worst_k = 0.0;
  for (std::size_t band = 0; band < apparent.size(); ++band) {
    worst_k = std::max(worst_k, apparent[band].rms_difference_k(full.radiance_w_m2_sr[band],
                                                                shed.radiance_w_m2_sr[band]));
  }
  return worst_k;
}

}  // namespace

Result<LadderSurvey> survey_ladder(const LadderSubject& subject, const FrameRequest& first,
                                   const WarmUpProgress& progress) {
  EMIT_CHECK(subject.triangles != nullptr);
  const std::vector<Place> at = places(subject.sensor, first);
  LadderSurvey survey;
  for (std::size_t p = 0; p < at.size(); ++p) {
    FrameRequest request = at[p].request;
    LadderMap::PerLevel levels{};
    // Render every level twice and keep the shorter time, because the first round also fills
    // caches.
    for (int round = 0; round < 2; ++round) {
      request.quality_level = 0;
      const Taken full(subject.renderer, request);
      for (std::size_t r = 0; r < kQualityLadder.size(); ++r) {
        request.quality_level = static_cast<std::uint8_t>(r);
        const Taken shed(subject.renderer, request);
        if (!full.good() || !shed.good()) {
          return make_error(ErrorCode::gpu, "the device failed in its first frames");
        }
        // Compare the level with full quality.
        levels[r].error_k = difference_k(full.view(), shed.view(), subject.apparent);
        levels[r].frame_ms =
            round == 0 ? shed.frame_ms() : std::min(levels[r].frame_ms, shed.frame_ms());
      }
    }
    // Add the times to the model of the cost.
    const TrianglesPerLevel triangles = subject.triangles(request);
    for (std::size_t r = 0; r < levels.size(); ++r) {
      survey.cost.add(triangles[r], rendered_pixels(kQualityLadder[r], subject.output_px),
                      levels[r].frame_ms);
    }
    // Add positions of the scenario to the map.
    if (at[p].on_trajectory) survey.map.add(request.sensor_pose, levels);
    if (progress && !progress(static_cast<double>(p + 1) / static_cast<double>(at.size()))) {
      return make_error(ErrorCode::internal, "stopped while the quality ladder was measured");
    }
  }
  survey.cost.fit();
  return survey;
}

}  // namespace emit::renderer
