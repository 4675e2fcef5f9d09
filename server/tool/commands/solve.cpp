// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/solve.hpp"

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "emit/scene/sheets.hpp"
#include "emit/scene/trajectory.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

struct SolveOptions {
  ScenarioChoice input;
  double time_s = 0.0;
  std::filesystem::path out;
  std::optional<std::filesystem::path> png;
  std::string png_of = "apparent";
  std::optional<std::filesystem::path> json;
  std::optional<std::filesystem::path> checkpoint;
  std::string dimension = "auto";  ///< "auto", "1" or "3"
  std::string band;                ///< empty: the scenario's first
  std::uint32_t rays = 256;
  std::uint32_t threads = 0;  ///< 0: all
  std::uint64_t pixels = 0;   ///< 0: all
  double refine = 1.0;
  double tolerance_k = 0.02;
};

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

/// Seconds that the steps of a solution took.
struct Times {
  double setup_s = 0.0;
  double history_s = 0.0;
  double image_s = 0.0;
};

/// The solution of one view, with what it took to compute it.
struct Solution {
  reference::SolvedImage image;
  reference::SolveReport report;
  Times times;
};

reference::SolveOptions solver_options(const SolveOptions& command, Progress& bar) {
  reference::SolveOptions options;
  options.dimension = command.dimension == "1"   ? reference::SolveDimension::one
                      : command.dimension == "3" ? reference::SolveDimension::three
                                                 : reference::SolveDimension::automatic;
  options.rays = command.rays;
  options.refine = command.refine;
  options.tolerance_k = command.tolerance_k;
  options.pixels = command.pixels;
  options.checkpoint = command.checkpoint.value_or(std::filesystem::path());
  options.progress = [&bar](double done_frac) {
    bar.advance_to(static_cast<std::uint64_t>(1000.0 * std::clamp(done_frac, 0.0, 1.0)));
    return !InterruptGuard::interrupted();
  };
  return options;
}

/// The view of the scenario's sensor at an instant. Errors: config, when the sensor has no
/// position.
physics::Result<reference::SolveView> sensor_view(const scene::ScenarioDesc& scenario,
                                                  std::int64_t sim_time_ns) {
  if (scenario.sensor.trajectory.empty()) {
    return physics::make_error(physics::ErrorCode::config, "the scenario's sensor has no position");
  }
  reference::SolveView view;
  view.sim_time_ns = sim_time_ns;
  view.width_px = scenario.sensor.width_px;
  view.height_px = scenario.sensor.height_px;
  view.fov_h_rad = scenario.sensor.fov_h_rad;
  view.sensor_pose = scene::trajectory_at(scenario.sensor.trajectory, sim_time_ns).pose;
  return view;
}

/// Errors: those of SceneSolver; internal when the user interrupts.
physics::Result<Solution> solve(const SolveOptions& command, const scene::ScenarioDesc& scenario,
                                const scene::SceneGeometry& geometry,
                                const reference::SolveView& view) {
  const InterruptGuard interrupts;
  Progress bar("solve", 1000);
  const auto interrupted = [](const char* advice) {
    return physics::make_error(physics::ErrorCode::internal, fmt::format("interrupted{}", advice));
  };
  Solution out;
  auto start = std::chrono::steady_clock::now();
  auto solver = reference::SceneSolver::create(scenario, geometry, solver_options(command, bar),
                                               view.sim_time_ns);
  if (!solver) return tl::unexpected(std::move(solver.error()));
  out.times.setup_s = seconds_since(start);
  start = std::chrono::steady_clock::now();
  if (const auto reached = solver->advance_to(view.sim_time_ns); !reached) {
    return tl::unexpected(reached.error());
  }
  out.times.history_s = seconds_since(start);
  if (solver->stopped()) {
    return interrupted(command.checkpoint ? "; run again to go on from the checkpoint" : "");
  }
  start = std::chrono::steady_clock::now();
  auto image = solver->image(view);
  if (!image) return tl::unexpected(std::move(image.error()));
  out.times.image_s = seconds_since(start);
  if (solver->stopped()) return interrupted("");
  out.image = std::move(*image);
  out.report = solver->report();
  return out;
}

physics::Result<void> write_files(const SolveOptions& command, const scene::ScenarioDesc& scenario,
                                  std::size_t band, const reference::SolveView& view,
                                  const reference::SolvedImage& image) {
  const scene::SpectralBand& shown = scenario.bands[band];
  FramePlanes planes;
  planes.width_px = image.width_px;
  planes.height_px = image.height_px;
  planes.radiance_w_m2_sr = image.radiance_w_m2_sr[band];
  planes.temperature_k = image.temperature_k;
  planes.depth_m = image.depth_m;
  planes.object_id = image.object_id;
  planes.metadata = {view.sim_time_ns, 1,           view.sensor_pose, shown.name,
                     shown.lo_um,      shown.hi_um, "W m-2 sr-1",     response_of(shown)};
  if (auto done = write_frame_exr(command.out, planes); !done) return done;
  if (!command.png) return {};
  return write_frame_png(
      *command.png, planes,
      {scenario.display.min_k, scenario.display.max_k, png_quantity(command.png_of)});
}

void print_solution(const SolveOptions& command, const Solution& solution) {
  const reference::SolveReport& report = solution.report;
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
             command.out.string(), solution.image.width_px, solution.image.height_px,
             command.time_s, solution.image.solved_px, solution.image.surface_px, model,
             solution.times.setup_s, solution.times.history_s, solution.times.image_s);
}

Json solution_json(const SolveOptions& command, const scene::ScenarioDesc& scenario,
                   std::size_t band, const Solution& solution) {
  const auto& [image, report, times] = solution;
  Json json = Json::object();
  json.set("scenario", scenario.name).set("sim_time_s", command.time_s);
  json.set("band", scenario.bands[band].name);
  json.set("width", image.width_px).set("height", image.height_px);
  json.set("dimension", report.dimension).set("refine", command.refine);
  json.set("rays", command.rays).set("tolerance_k", command.tolerance_k);
  json.set("surface_px", image.surface_px).set("solved_px", image.solved_px);
  json.set("nodes", report.nodes).set("faces", report.faces).set("patches", report.patches);
  json.set("resumed", report.resumed);
  json.set("history", stats_json(report.stats)).set("spin_up", stats_json(report.spin_up));
  json.set("setup_s", times.setup_s).set("history_s", times.history_s);
  json.set("picture_s", times.image_s);
  return json;
}

int run(const SolveOptions& command) {
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
  const auto view = sensor_view(*scenario, std::llround(command.time_s * 1e9));
  if (!view) return fail(view.error());

  std::optional<tbb::global_control> threads;
  if (command.threads > 0) {
    threads.emplace(tbb::global_control::max_allowed_parallelism,
                    static_cast<std::size_t>(command.threads));
  }
  const auto solution = solve(command, *scenario, *geometry, *view);
  if (!solution) return fail(solution.error());
  if (auto done = write_files(command, *scenario, *band, *view, solution->image); !done) {
    return fail(done.error());
  }
  print_solution(command, *solution);
  if (command.json) {
    const Json json = solution_json(command, *scenario, *band, *solution);
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  return kExitOk;
}

void add_options(CommandLine& line, SolveOptions& options) {
  add_scenario(line, options.input, "scenario");
  line.seconds("--time-s", options.time_s, "Simulated time since the scenario's epoch, s")
      .required();
  line.exr_file("--out", options.out, "OpenEXR file to write").required();
  line.png_file("--png", options.png, "False-colour image as PNG");
  add_png_of(line, options.png_of, true);
  line.option("--dimension", options.dimension,
              "Conduction: 3 (solids of axis-aligned faces, nothing moving), 1 (behind every "
              "pixel), auto (3 where it fits)")
      .one_of({"auto", "1", "3"})
      .show_default();
  line.option("--rays", options.rays, "Rays per face or pixel for sky and surroundings")
      .in_range(1U, 1U << 20U)
      .show_default();
  line.option("--refine", options.refine, "Three dimensions: multiplies cells per axis and steps")
      .in_range(0.1, 8.0)
      .show_default();
  line.option("--tolerance-k", options.tolerance_k,
              "Three dimensions: error of a step at refine 1, K")
      .positive()
      .show_default();
  line.count("--pixels", options.pixels,
             "Only so many surface pixels, always the same ones, the rest NaN; 0: all");
  line.output_folder("--checkpoint", options.checkpoint,
                     "Folder to save the three-dimensional history in, and to go on from");
  line.option("--threads", options.threads, "Threads; 0: one per core").show_default();
  line.option("--band", options.band, "Band of the radiance channel; default: the first")
      .type_name("NAME");
  add_json(line, options.json);
}

}  // namespace

void add_solve(CommandLine& tool) {
  tool.command<SolveOptions>(
      {.name = "solve",
       .text =
           "Reference solution: the picture of render by transient conduction and rays, in double",
       .example = "emit solve block-on-road --time-s 12600 --out truth.exr --checkpoint runs"},
      add_options, run);
}

}  // namespace emit::tool
