// SPDX-License-Identifier: Apache-2.0
#include "bench/frame_time/paper_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <memory>
#include <optional>
#include <utility>

#include "emit/renderer/renderer.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

using Clock = std::chrono::steady_clock;
using physics::Result;

/// The camera pans to and fro, so that the scene stays in view however many frames there are.
constexpr std::uint32_t kPanPeriodFrames = 40;

double pan_rad(const scene::SensorDesc& sensor, std::uint32_t frame) {
  const double px_rad = 2.0 * std::tan(0.5 * sensor.fov_h_rad) / sensor.width_px;
  const std::uint32_t phase = frame % kPanPeriodFrames;
  const std::uint32_t half = kPanPeriodFrames / 2;
  const double triangle = phase < half ? phase : kPanPeriodFrames - phase;
  return kPaperPanPx * px_rad * (triangle - 0.5 * half);
}

physics::Pose panned(const physics::Pose& base, double yaw_rad) {
  physics::Pose pose = base;
  // The camera pans about its own vertical, so that the image moves sideways whatever the pitch.
  pose.world_from_body =
      glm::normalize(base.world_from_body * glm::angleAxis(yaw_rad, glm::dvec3(0.0, 0.0, 1.0)));
  return pose;
}

/// Renders single frames of a run.
class PaperCamera {
 public:
  static Result<PaperCamera> create(const PaperRun& run, const renderer::OutputOptions& output) {
    auto created = renderer::Renderer::create(run.scenario, {run.gpu_index, false}, output);
    if (!created) return tl::unexpected(std::move(created.error()));
    return PaperCamera(run, std::move(*created));
  }

  [[nodiscard]] const renderer::Renderer& renderer() const { return *renderer_; }
  [[nodiscard]] physics::Pose pose(std::uint32_t frame) const {
    return panned(base_, pan_rad(run_.scenario.sensor, frame));
  }

  /// Submits a frame, waits for it, hands it to `take` with its time, and releases it.
  template <class Take>
  Result<void> render(std::uint32_t frame, const Take& take) {
    if (InterruptGuard::interrupted()) {
      return physics::make_error(physics::ErrorCode::io, "interrupted");
    }
    renderer::FrameRequest request;
    request.frame_number = number_++;
    request.sim_time_ns = run_.start_ns + run_.advance_ns * frame;
    request.thermal_time_ns = request.sim_time_ns;
    request.sensor_pose = pose(frame);
    const auto start = Clock::now();
    const int slot = renderer_->submit(request);
    if (slot < 0) {
      return physics::make_error(physics::ErrorCode::internal, "the renderer has no free slot");
    }
    const renderer::FrameView& view = renderer_->collect(static_cast<renderer::SlotIndex>(slot));
    const double frame_ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    if (view.device_failed) {
      return physics::make_error(physics::ErrorCode::gpu,
                                 fmt::format("frame {}: the device reported an error", frame));
    }
    take(view, frame_ms);
    renderer_->release(static_cast<renderer::SlotIndex>(slot));
    return {};
  }

 private:
  PaperCamera(const PaperRun& run, std::unique_ptr<renderer::Renderer> renderer)
      : run_(run),
        renderer_(std::move(renderer)),
        base_(renderer_->scenario_sensor_pose_at(run.start_ns)) {}

  const PaperRun& run_;
  std::unique_ptr<renderer::Renderer> renderer_;
  physics::Pose base_;
  std::uint64_t number_ = 0;
};

reference::SolveView view_of(const PaperRun& run, std::uint32_t frame, const physics::Pose& pose) {
  const scene::SensorDesc& sensor = run.scenario.sensor;
  return {run.start_ns + run.advance_ns * frame, pose, sensor.width_px, sensor.height_px,
          sensor.fov_h_rad};
}

}  // namespace

PaperRun make_paper_run(scene::ScenarioDesc scenario, const PaperMethod& method,
                        std::uint32_t steps, const PaperFrames& frames) {
  PaperRun run;
  run.method = method;
  scenario.sensor.width_px = frames.width_px;
  scenario.sensor.height_px = frames.height_px;
  scenario.thermal.method = method.method;
  scenario.thermal.steps = steps;
  // The spacing is as published. The method cached spaces its steps as it does anywhere else.
  scenario.thermal.spacing = method.method == scene::ThermalMethod::cached
                                 ? scene::StepSpacing::geometric
                                 : scene::StepSpacing::uniform;
  const std::int64_t from_ns = scenario.thermal.history_start_ns;
  run.start_ns = observation_ns(scenario);
  // Both methods and the reference share one thermal model: heat is conducted straight down, and
  // whatever hides the sky has the surroundings' temperature, as in the published one.
  scenario.thermal.lateral = false;
  scenario.thermal.exchange = false;
  const double interval_s = method.method == scene::ThermalMethod::cached
                                ? scenario.thermal.first_step_s
                                : 1e-9 * static_cast<double>(run.start_ns - from_ns) / steps;
  run.frames = std::max(frames.frames, method.least_frames);
  run.advance_ns = std::llround(1e9 * kPaperClosings * interval_s / (run.frames - 1));
  run.gpu_index = frames.gpu_index;
  run.scenario = std::move(scenario);
  return run;
}

Result<PaperTimes> time_frames(const PaperRun& run, bool stages, const PaperProgress& progress) {
  renderer::OutputOptions output;
  output.slots = 2;
  output.stage_timing = stages;
  auto camera = PaperCamera::create(run, output);
  if (!camera) return tl::unexpected(std::move(camera.error()));
  PaperTimes out;
  out.device = camera->renderer().device_name();
  out.triangles = camera->renderer().scene_stats().triangles;
  for (std::uint32_t i = 0; i <= run.frames; ++i) {
    const bool warm_up = i == 0;
    const auto done =
        camera->render(warm_up ? 0 : i - 1, [&](const renderer::FrameView& view, double frame_ms) {
          if (warm_up) return;
          out.frame_ms.add(frame_ms);
          const renderer::StageTimes& t = view.stages_ms;
          const std::array<double, 6> values{t.geometry_ms, t.occlusion_ms, t.shadow_ms,
                                             t.thermal_ms,  t.radiance_ms,  t.readback_ms};
          for (std::size_t s = 0; s < values.size(); ++s) out.stages_ms[s].add(values[s]);
        });
    if (!done) return tl::unexpected(done.error());
    progress();
  }
  return out;
}

Result<SceneFill> check_fill(const PaperRun& run) {
  renderer::OutputOptions output;
  output.slots = 2;
  output.temperature = output.depth = true;
  auto camera = PaperCamera::create(run, output);
  if (!camera) return tl::unexpected(std::move(camera.error()));
  std::optional<SceneFill> least;
  for (const std::uint32_t frame : {0U, std::min(run.frames - 1, kPanPeriodFrames / 2)}) {
    const auto done = camera->render(frame, [&](const renderer::FrameView& view, double) {
      const SceneFill fill =
          measure_fill(run.scenario.sensor, camera->pose(frame), view.depth_m, view.temperature_k);
      least = least ? least_of(*least, fill) : fill;
    });
    if (!done) return tl::unexpected(done.error());
  }
  return *least;
}

Result<std::vector<JudgedFrame>> judged_frames(const PaperRun& run) {
  renderer::OutputOptions output;
  output.slots = 2;
  output.temperature = true;
  auto camera = PaperCamera::create(run, output);
  if (!camera) return tl::unexpected(std::move(camera.error()));
  std::vector<JudgedFrame> out;
  for (std::uint32_t frame = 0; frame < run.frames; ++frame) {
    const bool judged = frame == 0 || frame + 1 == run.frames;
    if (!judged && !run.method.carries_state) continue;
    const auto done = camera->render(frame, [&](const renderer::FrameView& view, double) {
      if (!judged) return;
      out.push_back({view_of(run, frame, camera->pose(frame)),
                     {view.temperature_k.begin(), view.temperature_k.end()}});
    });
    if (!done) return tl::unexpected(done.error());
  }
  return out;
}

Result<reference::SolveView> first_view(const PaperRun& run) {
  const scene::Trajectory& trajectory = run.scenario.sensor.trajectory;
  if (trajectory.empty()) {
    return physics::make_error(physics::ErrorCode::config,
                               fmt::format("{}: the sensor has no trajectory", run.scenario.name));
  }
  const physics::Pose base = sample_trajectory(trajectory, run.start_ns, run.start_ns).pose;
  return view_of(run, 0, panned(base, pan_rad(run.scenario.sensor, 0)));
}

}  // namespace emit::tool
