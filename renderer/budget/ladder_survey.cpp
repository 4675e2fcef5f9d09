// SPDX-License-Identifier: Apache-2.0
#include "budget/ladder_survey.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/scene/trajectory.hpp"

namespace emit::renderer {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Places on the camera's way: errors in between are interpolated.
constexpr int kPlaces = 12;
/// Directions of a camera that stands still.
constexpr int kDirections = 4;

struct Place {
  FrameRequest request;
  bool on_the_way = true;  ///< where the scenario has the camera
};

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
    FrameRequest next = first;  // the thermal clock stands still meanwhile
    const double way = static_cast<double>(i) / (kPlaces - 1);
    next.sim_time_ns += std::llround(way * static_cast<double>(end_ns - first.sim_time_ns));
    next.sensor_pose = trajectory_at(sensor.trajectory, next.sim_time_ns).pose;
    out.push_back({next});
  }
  return out;
}

/// A frame in a slot of the renderer.
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

double difference_k(const FrameView& full, const FrameView& shed,
                    std::span<const physics::ApparentTemperature> apparent) {
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
  const std::vector<Place> at = places(subject.sensor, first);
  LadderSurvey survey;
  for (std::size_t p = 0; p < at.size(); ++p) {
    FrameRequest request = at[p].request;
    LadderMap::OfRungs rungs{};
    for (int round = 0; round < 2; ++round) {  // the first one also fills caches
      request.rung = 0;
      const Taken full(subject.renderer, request);
      for (std::size_t r = 0; r < kQualityLadder.size(); ++r) {
        request.rung = static_cast<std::uint8_t>(r);
        const Taken shed(subject.renderer, request);
        if (!full.good() || !shed.good()) {
          return make_error(ErrorCode::gpu, "the device failed in its first frames");
        }
        rungs[r].error_k = difference_k(full.view(), shed.view(), subject.apparent);
        rungs[r].frame_ms =
            round == 0 ? shed.frame_ms() : std::min(rungs[r].frame_ms, shed.frame_ms());
      }
    }
    const TrianglesOfRungs triangles = subject.triangles(request);
    for (std::size_t r = 0; r < rungs.size(); ++r) {
      survey.cost.add(triangles[r], rendered_pixels(kQualityLadder[r], subject.picture_px),
                      rungs[r].frame_ms);
    }
    if (at[p].on_the_way) survey.map.add(request.sensor_pose, rungs);
    if (progress && !progress(static_cast<double>(p + 1) / static_cast<double>(at.size()))) {
      return make_error(ErrorCode::internal, "stopped while the quality ladder was measured");
    }
  }
  survey.cost.fit();
  return survey;
}

}  // namespace emit::renderer
