// SPDX-License-Identifier: Apache-2.0
#include "passes/ladder_survey.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>

#include "emit/scene/trajectory.hpp"

namespace emit::renderer {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Places on the camera's way: errors in between are interpolated.
constexpr int kPlaces = 12;

std::vector<FrameRequest> places(const scene::SensorDesc& sensor, const FrameRequest& first) {
  std::vector<FrameRequest> out{first};
  if (sensor.trajectory.size() < 2) return out;
  const std::int64_t end_ns = sensor.trajectory[sensor.trajectory.size() - 1].sim_time_ns;
  for (int i = 1; i < kPlaces && first.sim_time_ns < end_ns; ++i) {
    FrameRequest next = first;  // the thermal clock stands still meanwhile
    const double way = static_cast<double>(i) / (kPlaces - 1);
    next.sim_time_ns += std::llround(way * static_cast<double>(end_ns - first.sim_time_ns));
    next.sensor_pose = trajectory_at(sensor.trajectory, next.sim_time_ns).pose;
    out.push_back(next);
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

Result<LadderMap> survey_ladder(Renderer& renderer, const scene::SensorDesc& sensor,
                                std::span<const physics::ApparentTemperature> apparent,
                                const FrameRequest& first, const WarmUpProgress& progress) {
  const std::vector<FrameRequest> at = places(sensor, first);
  LadderMap map;
  for (std::size_t p = 0; p < at.size(); ++p) {
    FrameRequest request = at[p];
    LadderMap::OfRungs rungs{};
    for (int round = 0; round < 2; ++round) {  // the first one also fills caches
      request.rung = 0;
      const Taken full(renderer, request);
      for (std::size_t r = 0; r < kQualityLadder.size(); ++r) {
        request.rung = static_cast<std::uint8_t>(r);
        const Taken shed(renderer, request);
        if (!full.good() || !shed.good()) {
          return make_error(ErrorCode::gpu, "the device failed in its first frames");
        }
        rungs[r].error_k = difference_k(full.view(), shed.view(), apparent);
        rungs[r].frame_ms =
            round == 0 ? shed.frame_ms() : std::min(rungs[r].frame_ms, shed.frame_ms());
      }
    }
    map.add(request.sensor_pose, rungs);
    if (progress && !progress(static_cast<double>(p + 1) / static_cast<double>(at.size()))) {
      return make_error(ErrorCode::internal, "stopped while the quality ladder was measured");
    }
  }
  return map;
}

}  // namespace emit::renderer
