// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <optional>

#include "bench_rules.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "emit/renderer/renderer.hpp"
#include "emit/version.hpp"
#include "interrupt.hpp"
#include "json.hpp"
#include "scenario_input.hpp"
#include "statistics.hpp"

namespace emit::cli {
namespace {

using Clock = std::chrono::steady_clock;
using physics::Result;

/// Horizontal motion of the picture's centre per frame, px; elsewhere in the picture it is more.
constexpr double kPanPx = 2.5;
/// The camera pans to and fro, so that the scene stays in view however many frames there are.
constexpr std::uint32_t kPanPeriodFrames = 40;
/// Closings of the newest history interval that a run crosses.
constexpr double kClosings = 3.2;
/// Frame rate that `time_scale` refers to.
constexpr double kNominalRateHz = 200.0;

struct Run {
  scene::ScenarioDesc scenario;
  std::int64_t start_ns = 0;
  std::int64_t advance_ns = 0;
  std::uint32_t frames = 0;
  int gpu_index = -1;
};

struct Measured {
  Samples frame_ms;
  std::array<Samples, 6> stages_ms;
  Samples fill_frac;
  std::string device;
  std::uint64_t triangles = 0;
};

double pan_rad(const scene::SensorDesc& sensor, std::uint32_t frame) {
  const double px_rad = 2.0 * std::tan(0.5 * sensor.fov_h_rad) / sensor.width_px;
  const std::uint32_t phase = frame % kPanPeriodFrames;
  const std::uint32_t half = kPanPeriodFrames / 2;
  const double triangle = phase < half ? phase : kPanPeriodFrames - phase;
  return kPanPx * px_rad * (triangle - 0.5 * half);
}

physics::Pose panned(const physics::Pose& base, double yaw_rad) {
  physics::Pose pose = base;
  // About the camera's own vertical: the picture moves sideways whatever the pitch.
  pose.world_from_body =
      glm::normalize(base.world_from_body * glm::angleAxis(yaw_rad, glm::dvec3(0.0, 0.0, 1.0)));
  return pose;
}

Run make_run(scene::ScenarioDesc scenario, std::uint32_t steps, const BenchPaperCommand& command) {
  Run run;
  scenario.sensor.width_px = command.width_px;
  scenario.sensor.height_px = command.height_px;
  scenario.thermal.method = scene::ThermalMethod::per_frame;
  scenario.thermal.steps = steps;
  scenario.thermal.spacing = scene::StepSpacing::uniform;  // as published
  const std::int64_t from_ns = scenario.thermal.history_start_ns;
  run.start_ns = observation_ns(scenario);
  const double interval_s = 1e-9 * static_cast<double>(run.start_ns - from_ns) / steps;
  run.frames = command.frames;
  run.advance_ns = std::llround(1e9 * kClosings * interval_s / (command.frames - 1));
  run.gpu_index = command.gpu_index;
  run.scenario = std::move(scenario);
  return run;
}

Result<void> device_error(std::uint64_t frame) {
  return physics::make_error(physics::ErrorCode::gpu,
                             fmt::format("frame {}: the device reported an error", frame));
}

/// Shares of the picture over the run's first frame and the one after half a pan: not timed, so
/// that the planes it needs cost the measured frames nothing.
Result<SceneFill> check_fill(const Run& run) {
  renderer::OutputOptions output;
  output.slots = 2;
  output.temperature = output.depth = true;
  const auto created = renderer::Renderer::create(run.scenario, {run.gpu_index, false}, output);
  if (!created) return tl::unexpected(created.error());
  renderer::Renderer& renderer = **created;
  const physics::Pose base = renderer.scenario_sensor_pose_at(run.start_ns);
  std::optional<SceneFill> least;
  for (const std::uint32_t frame : {0U, std::min(run.frames - 1, kPanPeriodFrames / 2)}) {
    renderer::FrameRequest request;
    request.frame_number = frame + 1;
    request.sim_time_ns = run.start_ns + run.advance_ns * frame;
    request.thermal_time_ns = request.sim_time_ns;
    request.sensor_pose = panned(base, pan_rad(run.scenario.sensor, frame));
    const int slot = renderer.submit(request);
    if (slot < 0) {
      return physics::make_error(physics::ErrorCode::internal, "the renderer has no free slot");
    }
    const auto& view = renderer.collect(static_cast<renderer::SlotIndex>(slot));
    if (view.device_failed) return tl::unexpected(device_error(frame).error());
    const SceneFill fill =
        measure_fill(run.scenario.sensor, request.sensor_pose, view.depth_m, view.temperature_k);
    least = least ? least_of(*least, fill) : fill;
    renderer.release(static_cast<renderer::SlotIndex>(slot));
  }
  return *least;
}

/// One pass over the frames of a run after a warm-up frame. With `stages` the device is waited for
/// after each stage, so that the stages can be told apart.
Result<void> measure(const Run& run, bool stages, ProgressBar& progress, std::uint64_t& done,
                     Measured& out) {
  renderer::OutputOptions output;
  output.slots = 2;
  output.stage_timing = stages;
  const auto created = renderer::Renderer::create(run.scenario, {run.gpu_index, false}, output);
  if (!created) return tl::unexpected(created.error());
  renderer::Renderer& renderer = **created;
  out.device = renderer.device_name();
  out.triangles = renderer.scene_stats().triangles;
  const physics::Pose base = renderer.scenario_sensor_pose_at(run.start_ns);
  const double pixels =
      static_cast<double>(run.scenario.sensor.width_px) * run.scenario.sensor.height_px;
  for (std::uint32_t i = 0; i <= run.frames; ++i) {
    if (InterruptGuard::interrupted()) {
      return physics::make_error(physics::ErrorCode::io, "interrupted");
    }
    const bool warm_up = i == 0;
    const std::uint32_t frame = warm_up ? 0 : i - 1;
    renderer::FrameRequest request;
    request.frame_number = i;
    request.sim_time_ns = run.start_ns + run.advance_ns * frame;
    request.thermal_time_ns = request.sim_time_ns;
    request.sensor_pose = panned(base, pan_rad(run.scenario.sensor, frame));
    const auto start = Clock::now();
    const int slot = renderer.submit(request);
    if (slot < 0) {
      return physics::make_error(physics::ErrorCode::internal, "the renderer has no free slot");
    }
    const auto& view = renderer.collect(static_cast<renderer::SlotIndex>(slot));
    const double frame_ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    if (view.device_failed) return device_error(i);
    if (!warm_up) {
      out.frame_ms.add(frame_ms);
      out.fill_frac.add(view.stats.surface_px / pixels);
      const renderer::StageTimes& t = view.stages_ms;
      const std::array<double, 6> values{t.geometry_ms, t.occlusion_ms, t.shadow_ms,
                                         t.thermal_ms,  t.radiance_ms,  t.readback_ms};
      for (std::size_t s = 0; s < values.size(); ++s) out.stages_ms[s].add(values[s]);
    }
    renderer.release(static_cast<renderer::SlotIndex>(slot));
    progress.advance_to(++done);
  }
  return {};
}

Json result_json(const std::string& scene, std::uint32_t steps, const Run& run,
                 const Measured& free_run, const Measured& serial, const SceneFill& fill) {
  static constexpr std::array<const char*, 6> kStages{"geometry", "occlusion", "shadow",
                                                      "thermal",  "radiance",  "readback"};
  Json stages = Json::object();
  double serial_ms = 0.0;
  for (std::size_t i = 0; i < kStages.size(); ++i) {
    stages.set(kStages[i], serial.stages_ms[i].mean());
    serial_ms += serial.stages_ms[i].mean();
  }
  const double advance_s = 1e-9 * static_cast<double>(run.advance_ns);
  Json json = Json::object();
  json.set("scene", scene).set("steps", steps).set("method", "per-frame");
  json.set("frame_ms_median", free_run.frame_ms.median());
  json.set("frame_ms_mean", free_run.frame_ms.mean());
  json.set("frame_ms_p99", free_run.frame_ms.percentile(0.99));
  json.set("frame_ms_max", free_run.frame_ms.max());
  json.set("stages_ms", std::move(stages)).set("frame_serial_ms", serial_ms);
  json.set("frame_serial_wall_ms", serial.frame_ms.mean());
  json.set("time_scale", advance_s * kNominalRateHz);
  json.set("max_error_k", nullptr).set("rms_error_k", nullptr).set("p99_error_k", nullptr);
  json.set("edge_p99_k", nullptr).set("pixels_compared", nullptr).set("reference", nullptr);
  json.set("frames", run.frames).set("triangles", free_run.triangles);
  json.set("width", run.scenario.sensor.width_px).set("height", run.scenario.sensor.height_px);
  json.set("spacing", "uniform").set("camera_px_per_frame", kPanPx);
  json.set("nominal_rate_hz", kNominalRateHz).set("sim_advance_s_per_frame", advance_s);
  json.set("newest_interval_closings", kClosings);
  const bool statue = scene == "statue";
  json.set("surface_fill_frac", free_run.fill_frac.mean());
  json.set("statue_fill_frac", statue ? Json(fill.figure_frac) : Json(nullptr));
  json.set("swept_ground_frac", fill.swept_ground_frac);
  json.set("rules_met", broken_rules(fill, statue).empty());
  return json;
}

}  // namespace

int run_bench_paper(const BenchPaperCommand& command) {
  const std::vector<std::string> scenes =
      command.scenes.empty() ? std::vector<std::string>{"box", "statue"} : command.scenes;
  const std::vector<std::uint32_t> steps =
      command.steps.empty() ? std::vector<std::uint32_t>{27, 90} : command.steps;
  const InterruptGuard interrupt;
  ProgressBar progress("bench paper",
                       scenes.size() * steps.size() * 2 * (std::uint64_t{command.frames} + 1));
  std::uint64_t done = 0;
  std::string device;
  Json results = Json::array();
  TextTable table({"scene", "steps", "median ms", "max ms", "geometry", "occlusion", "shadow",
                   "thermal", "radiance", "readback", "serial ms", "fill"});
  for (const std::string& scene : scenes) {
    const auto scenario = load_scenario_choice({scene, {}});
    if (!scenario) return fail_config(scenario.error());
    // The shares hang on camera and sun, not on the number of steps: the cheapest tells.
    const auto fill =
        check_fill(make_run(*scenario, *std::min_element(steps.begin(), steps.end()), command));
    if (!fill) return fail(fill.error());
    for (const std::string& text : broken_rules(*fill, scene == "statue")) {
      warn(fmt::format("{}: {}", scene, text));
    }
    for (const std::uint32_t count : steps) {
      const Run run = make_run(*scenario, count, command);
      Measured free_run;
      Measured serial;
      for (const bool stages : {false, true}) {
        if (auto ok = measure(run, stages, progress, done, stages ? serial : free_run); !ok) {
          return fail(ok.error());
        }
      }
      device = free_run.device;
      results.push(result_json(scene, count, run, free_run, serial, *fill));
      const auto ms = [](double value) { return fmt::format("{:.1f}", value); };
      double serial_ms = 0.0;
      std::vector<std::string> row{scene, fmt::format("{}", count), ms(free_run.frame_ms.median()),
                                   ms(free_run.frame_ms.max())};
      for (const Samples& stage : serial.stages_ms) {
        row.push_back(ms(stage.mean()));
        serial_ms += stage.mean();
      }
      row.push_back(ms(serial_ms));
      row.push_back(fmt::format("{:.0f} %", 100.0 * free_run.fill_frac.mean()));
      table.add(std::move(row));
    }
  }
  progress.finish();
  if (command.json != std::filesystem::path("-")) {
    fmt::print("{}, commit {}, {}x{}, {} frames each, method per-frame\n{}", device, kCommit,
               command.width_px, command.height_px, command.frames, table.to_string());
  }
  if (command.json) {
    Json json = Json::object();
    json.set("device", device).set("commit", kCommit).set("suite", "paper");
    json.set("results", std::move(results));
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  return kExitOk;
}

}  // namespace emit::cli
