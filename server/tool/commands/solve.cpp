// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/solve.hpp"

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "tool/commands/commands.hpp"
#include "tool/support/console.hpp"
#include "emit/scene/sheets.hpp"
#include "emit/scene/trajectory.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

Json stats_json(const reference::SolidStats& stats) {
  Json json = Json::object();
  json.set("steps", stats.steps).set("rejected", stats.rejected);
  json.set("newton_iterations", stats.newton_iterations);
  json.set("linear_iterations", stats.linear_iterations);
  return json;
}

}  // namespace

int run_solve(const SolveCommand& command) {
  const auto scenario = load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  const auto band = find_band(*scenario, command.band);
  if (!band) return fail(kExitUsage, band.error().text);
  if (!std::isfinite(command.time_s) || std::abs(command.time_s) > 9e9) {
    return fail(kExitUsage, "--time-s: not a time");
  }
  auto geometry = scene::load_scene(*scenario);
  if (!geometry) return fail_config(geometry.error());
  scene::adopt_sheets(*geometry);
  for (const std::string& text : scenario->warnings) warn(text);
  for (const std::string& text : geometry->warnings) warn(text);

  std::optional<tbb::global_control> threads;
  if (command.threads > 0) {
    threads.emplace(tbb::global_control::max_allowed_parallelism,
                    static_cast<std::size_t>(command.threads));
  }
  const InterruptGuard interrupts;
  ProgressBar bar("solve", 1000);
  reference::SolveOptions options;
  options.dimension = command.dimension == "1"   ? reference::SolveDimension::one
                      : command.dimension == "3" ? reference::SolveDimension::three
                                                 : reference::SolveDimension::automatic;
  options.rays = command.rays;
  options.refine = command.refine;
  options.tolerance_k = command.tolerance_k;
  options.pixels = command.pixels;
  options.checkpoint = command.checkpoint.value_or(std::filesystem::path());
  options.progress = [&](double done_frac) {
    bar.advance_to(static_cast<std::uint64_t>(1000.0 * std::clamp(done_frac, 0.0, 1.0)));
    return !InterruptGuard::interrupted();
  };

  reference::SolveView view;
  view.sim_time_ns = std::llround(command.time_s * 1e9);
  view.width_px = scenario->sensor.width_px;
  view.height_px = scenario->sensor.height_px;
  view.fov_h_rad = scenario->sensor.fov_h_rad;
  if (scenario->sensor.trajectory.empty()) {
    return fail(kExitConfig, "the scenario's sensor has no position");
  }
  view.sensor_pose = scene::trajectory_at(scenario->sensor.trajectory, view.sim_time_ns).pose;

  const auto start = std::chrono::steady_clock::now();
  auto solver = reference::SceneSolver::create(*scenario, *geometry, options, view.sim_time_ns);
  if (!solver) return fail(solver.error());
  const double setup_s = seconds_since(start);
  const auto history_start = std::chrono::steady_clock::now();
  if (const auto reached = solver->advance_to(view.sim_time_ns); !reached) {
    return fail(reached.error());
  }
  const double history_s = seconds_since(history_start);
  if (solver->stopped()) {
    bar.finish();
    return fail(kExitFailure, command.checkpoint
                                  ? "interrupted; run again to go on from the checkpoint"
                                  : "interrupted");
  }
  const auto image_start = std::chrono::steady_clock::now();
  const auto image = solver->image(view);
  if (!image) return fail(image.error());
  const double image_s = seconds_since(image_start);
  bar.finish();
  if (solver->stopped()) return fail(kExitFailure, "interrupted");

  const scene::SpectralBand& shown = scenario->bands[*band];
  FramePlanes planes;
  planes.width_px = image->width_px;
  planes.height_px = image->height_px;
  planes.radiance_w_m2_sr = image->radiance_w_m2_sr[*band];
  planes.temperature_k = image->temperature_k;
  planes.depth_m = image->depth_m;
  planes.object_id = image->object_id;
  planes.metadata = {view.sim_time_ns, 1,           view.sensor_pose, shown.name,
                     shown.lo_um,      shown.hi_um, "W m-2 sr-1",     response_of(shown)};
  if (auto done = write_frame_exr(command.out, planes); !done) return fail(done.error());
  if (command.png) {
    const ColorLimits limits{scenario->display.min_k, scenario->display.max_k};
    if (auto done = write_frame_png(*command.png, planes, limits); !done) return fail(done.error());
  }

  const reference::SolveReport report = solver->report();
  std::string model = "one-dimensional";
  if (report.dimension == 3) {
    model =
        fmt::format("three-dimensional, {} nodes, {} faces, {} patches, {} steps ({} rejected){}",
                    report.nodes, report.faces, report.patches, report.stats.steps,
                    report.stats.rejected, report.resumed ? ", from the checkpoint" : "");
  }
  fmt::print(text_stream(command.json),
             "{}: {}x{}, sim time {:.3f} s, {} of {} surface pixels; {}; setup {:.1f} s, history "
             "{:.1f} s, picture {:.1f} s\n",
             command.out.string(), image->width_px, image->height_px, command.time_s,
             image->solved_px, image->surface_px, model, setup_s, history_s, image_s);
  if (command.json) {
    Json json = Json::object();
    json.set("scenario", scenario->name).set("sim_time_s", command.time_s);
    json.set("band", shown.name).set("width", image->width_px).set("height", image->height_px);
    json.set("dimension", report.dimension).set("refine", command.refine);
    json.set("rays", command.rays).set("tolerance_k", command.tolerance_k);
    json.set("surface_px", image->surface_px).set("solved_px", image->solved_px);
    json.set("nodes", report.nodes).set("faces", report.faces).set("patches", report.patches);
    json.set("resumed", report.resumed);
    json.set("history", stats_json(report.stats)).set("spin_up", stats_json(report.spin_up));
    json.set("setup_s", setup_s).set("history_s", history_s).set("picture_s", image_s);
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  return kExitOk;
}

}  // namespace emit::tool
