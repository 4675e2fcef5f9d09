// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/offline_frames.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "emit/physics/check.hpp"
#include "emit/scene/trajectory.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"

namespace emit::tool {
namespace {

using Clock = std::chrono::steady_clock;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

double ms_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

/// Surfaces need only be fine enough for the shots, unless their state is shared with other runs.
void keep_only_views_of(std::span<const OfflineShot> shots, scene::ScenarioDesc& scenario) {
  if (!scenario.thermal.state_file.empty()) return;
  scenario.sensor.trajectory.clear();
  scene::Trajectory& eyes = scenario.sensor.trajectory;
  for (const OfflineShot& shot : shots) {
    const auto same_pose = [&shot](const scene::Keyframe& key) {
      return key.pose.position_world_m == shot.sensor_pose.position_world_m &&
             key.pose.world_from_body == shot.sensor_pose.world_from_body;
    };
    if (std::ranges::any_of(eyes, same_pose)) continue;
    // Keyframes ascend in time, so shots of one instant lie a nanosecond apart.
    const std::int64_t from_ns = eyes.empty() ? shot.sim_time_ns : eyes.back().sim_time_ns + 1;
    eyes.push_back({std::max(shot.sim_time_ns, from_ns), shot.sensor_pose, true, shot.jump});
  }
}

}  // namespace

std::vector<OfflineShot> sensor_shots(const scene::ScenarioDesc& scenario,
                                      std::span<const double> times_s) {
  std::vector<OfflineShot> shots;
  for (const double time_s : times_s) {
    OfflineShot shot;
    shot.sim_time_ns = std::llround(time_s * 1e9);
    if (!scenario.sensor.trajectory.empty()) {
      shot.sensor_pose = scene::trajectory_at(scenario.sensor.trajectory, shot.sim_time_ns).pose;
    }
    shots.push_back(shot);
  }
  return shots;
}

OfflineFrames::OfflineFrames(std::span<const OfflineShot> shots)
    : shots_(shots.begin(), shots.end()), bar_("frames", shots.size() * kShareParts) {}

renderer::FrameRequest OfflineFrames::request(std::size_t index) const {
  renderer::FrameRequest out;
  out.frame_number = index + 1;
  out.sim_time_ns = out.thermal_time_ns = shots_[index].sim_time_ns;
  out.sensor_pose = shots_[index].sensor_pose;
  out.fov_h_rad = shots_[index].fov_h_rad;
  out.window_px = shots_[index].window_px;
  return out;
}

Result<std::unique_ptr<OfflineFrames>> OfflineFrames::create(scene::ScenarioDesc scenario,
                                                             std::span<const OfflineShot> shots,
                                                             const renderer::OutputOptions& output,
                                                             int gpu_index,
                                                             SceneWarnings warnings) {
  EMIT_CHECK(!shots.empty());
  std::unique_ptr<OfflineFrames> out(new OfflineFrames(shots));
  keep_only_views_of(shots, scenario);
  auto start = Clock::now();
  auto created = renderer::Renderer::create(scenario, {gpu_index, false}, output);
  if (!created) return tl::unexpected(std::move(created.error()));
  out->renderer_ = std::move(*created);
  out->setup_ms_ = ms_since(start);
  const auto tell = [warnings](const std::vector<std::string>& texts) {
    if (warnings == SceneWarnings::known) return;
    for (const std::string& text : texts) warn(text);
  };
  tell(out->renderer_->scene_stats().warnings);
  std::vector<std::int64_t> planned_ns;
  for (const OfflineShot& shot : out->shots_) {
    if (planned_ns.empty() || planned_ns.back() != shot.sim_time_ns) {
      planned_ns.push_back(shot.sim_time_ns);
    }
  }
  out->renderer_->plan(planned_ns);
  start = Clock::now();
  {
    Progress bar("warm-up", kShareParts);
    auto warm = out->renderer_->warm_up(out->request(0), share_of(bar));
    if (!warm) return tl::unexpected(std::move(warm.error()));
  }
  out->warm_up_ms_ = ms_since(start);
  tell(renderer::warm_up_warnings(out->renderer_->scene_stats()));
  return out;
}

void OfflineFrames::release() {
  if (slot_ >= 0) renderer_->release(static_cast<renderer::SlotIndex>(slot_));
  slot_ = -1;
}

Result<const renderer::FrameView*> OfflineFrames::next() {
  EMIT_CHECK_OP(next_, <, shots_.size());
  release();
  if (InterruptGuard::interrupted()) return make_error(ErrorCode::internal, "interrupted");
  const renderer::FrameRequest wanted = request(next_);
  if (next_ > 0) {
    auto there = renderer_->carry_on(wanted, share_of(bar_, next_ * kShareParts));
    if (!there) return tl::unexpected(std::move(there.error()));
  }
  const auto start = Clock::now();
  slot_ = renderer_->submit(wanted);
  if (slot_ < 0) return make_error(ErrorCode::internal, "the renderer has no free slot");
  const renderer::FrameView& view = renderer_->collect(static_cast<renderer::SlotIndex>(slot_));
  frame_ms_ = ms_since(start);
  if (view.device_failed) {
    return make_error(ErrorCode::gpu, "the device reported an error: the frame is not written");
  }
  ++next_;
  if (next_ < shots_.size()) bar_.advance_to(next_ * kShareParts);
  return &view;
}

}  // namespace emit::tool
