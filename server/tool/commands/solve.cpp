// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/solve.hpp"

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>
#include <tuple>

#include "emit/scene/sheets.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/offline/time_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/output_check.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/replacing_file.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/truth/probe_file.hpp"
#include "tool/truth/view_plan.hpp"

namespace emit::tool {
namespace {

struct SolveOptions {
  ScenarioChoice input;
  TimeChoice times;
  std::filesystem::path out;  ///< empty: no pictures
  std::optional<std::filesystem::path> png;
  std::string png_of = "apparent";
  std::optional<std::filesystem::path> at;
  std::filesystem::path at_out = "-";
  std::vector<std::string> cameras;
  std::optional<std::filesystem::path> json;
  std::optional<std::filesystem::path> checkpoint;
  std::string dimension = "auto";  ///< "auto", "1" or "3"
  std::vector<std::string> bands;  ///< empty: the scenario's first
  std::uint32_t rays = 256;
  std::uint32_t threads = 0;  ///< 0: all
  std::uint64_t pixels = 0;   ///< 0: all
  double refine = 1.0;
  double tolerance_k = 0.02;
  double spin_up_h = 72.0;
};

/// All pictures and tables of one run.
struct SolvePlan {
  std::vector<double> times_s;       ///< ascending
  std::vector<std::size_t> bands;    ///< indices into the scenario's bands
  std::vector<SolveCamera> cameras;  ///< empty without pictures
  std::vector<reference::SolveProbe> probes;
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

reference::SolveOptions solver_options(const SolveOptions& command, Progress& bar) {
  reference::SolveOptions options;
  options.dimension = command.dimension == "1"   ? reference::SolveDimension::one
                      : command.dimension == "3" ? reference::SolveDimension::three
                                                 : reference::SolveDimension::automatic;
  options.rays = command.rays;
  options.refine = command.refine;
  options.tolerance_k = command.tolerance_k;
  options.pixels = command.pixels;
  options.spin_up_s = 3600.0 * command.spin_up_h;
  options.checkpoint = command.checkpoint.value_or(std::filesystem::path());
  options.progress = share_of(bar);
  return options;
}

/// Errors: invalid_argument (a time that is none, an unknown band, a camera), those of
/// read_probes().
physics::Result<SolvePlan> make_plan(const SolveOptions& command,
                                     const scene::ScenarioDesc& scenario) {
  SolvePlan plan;
  auto times_s = resolve_times(command.times, scenario);
  if (!times_s) return tl::unexpected(std::move(times_s.error()));
  plan.times_s = std::move(*times_s);
  const std::vector<std::string> first{""};
  for (const std::string& name : command.bands.empty() ? first : command.bands) {
    const auto band = find_band(scenario, name);
    if (!band) return tl::unexpected(band.error());
    if (std::ranges::find(plan.bands, *band) == plan.bands.end()) plan.bands.push_back(*band);
  }
  if (!command.out.empty()) {
    for (const std::string& text : command.cameras) {
      auto camera = parse_camera(text);
      if (!camera) return tl::unexpected(std::move(camera.error()).with_context("--camera"));
      plan.cameras.push_back(std::move(*camera));
    }
    if (plan.cameras.empty()) plan.cameras.emplace_back();
  }
  if (command.at) {
    auto probes = read_probes(*command.at, scenario);
    if (!probes) return tl::unexpected(std::move(probes.error()));
    plan.probes = std::move(*probes);
  }
  return plan;
}

/// Returns the names of the pictures of one camera.
FrameFileNames names_of(const std::filesystem::path& pattern, const SolvePlan& plan,
                        const SolveCamera& camera) {
  return FrameFileNames(camera_pattern(pattern, camera.name, plan.cameras.size() > 1),
                        plan.times_s.size() > 1, plan.bands.size() > 1);
}

/// Errors: io, naming the option and the file that cannot be written.
physics::Result<void> check_pictures(const SolveOptions& command, const SolvePlan& plan,
                                     const scene::ScenarioDesc& scenario) {
  for (const SolveCamera& camera : plan.cameras) {
    for (const double time_s : plan.times_s) {
      for (const std::size_t band : plan.bands) {
        const std::string& name = scenario.bands[band].name;
        auto exr = check_output_file(names_of(command.out, plan, camera).file(time_s, name));
        if (!exr) return tl::unexpected(std::move(exr.error()).with_context("--out"));
        if (!command.png) continue;
        auto png = check_output_file(names_of(*command.png, plan, camera).file(time_s, name));
        if (!png) return tl::unexpected(std::move(png.error()).with_context("--png"));
      }
    }
  }
  return {};
}

/// One run: it solves the plan and writes files, lines and JSON.
class Solving {
 public:
  Solving(const SolveOptions& command, const scene::ScenarioDesc& scenario, const SolvePlan& plan)
      : command_(command), scenario_(scenario), plan_(plan) {}
  /// Errors: those of SceneSolver; io; internal when the user interrupts.
  [[nodiscard]] physics::Result<void> run(const scene::SceneGeometry& geometry);

 private:
  [[nodiscard]] physics::Result<void> solve_instant(double time_s);
  [[nodiscard]] physics::Result<void> solve_probes(double time_s);
  [[nodiscard]] physics::Result<void> write_picture(const SolveCamera& camera, double time_s,
                                                    const reference::SolveView& view,
                                                    const reference::SolvedImage& image);
  void check_view(const SolveCamera& camera, double time_s,
                  const reference::SolvedImage& image) const;
  [[nodiscard]] physics::Result<void> interrupted(const char* advice) const {
    return physics::make_error(physics::ErrorCode::internal, fmt::format("interrupted{}", advice));
  }
  /// Returns the stream of the lines for people: tables on standard output keep it for themselves.
  [[nodiscard]] std::FILE* lines() const {
    return command_.at && command_.at_out == "-" ? stderr : text_stream(command_.json);
  }
  [[nodiscard]] std::string model_text() const;
  [[nodiscard]] physics::Result<void> write_tables() const;

  const SolveOptions& command_;
  const scene::ScenarioDesc& scenario_;
  const SolvePlan& plan_;
  std::optional<reference::SceneSolver> solver_;
  Times times_;
  std::string table_;
  std::vector<Json> pictures_;
};

std::string Solving::model_text() const {
  const reference::SolveReport report = solver_->report();
  if (report.dimension == 1) return fmt::format("one-dimensional ({})", report.reason);
  return fmt::format(
      "three-dimensional ({}), {} nodes, {} faces, {} patches, {} steps ({} "
      "rejected){}",
      report.reason, report.nodes, report.faces, report.patches, report.stats.steps,
      report.stats.rejected, report.resumed ? ", from the checkpoint" : "");
}

/// Warns of a picture that may not be what the user wanted.
void Solving::check_view(const SolveCamera& camera, double time_s,
                         const reference::SolvedImage& image) const {
  if (image.surface_px > 0) return;
  warn(fmt::format("sim time {:g} s{}: the view shows nothing but sky", time_s,
                   camera.name.empty() ? "" : fmt::format(", camera {}", camera.name)));
}

physics::Result<void> Solving::write_picture(const SolveCamera& camera, double time_s,
                                             const reference::SolveView& view,
                                             const reference::SolvedImage& image) {
  for (const std::size_t band : plan_.bands) {
    const scene::SpectralBand& shown = scenario_.bands[band];
    FramePlanes planes;
    planes.width_px = image.width_px;
    planes.height_px = image.height_px;
    planes.radiance_w_m2_sr = image.radiance_w_m2_sr[band];
    planes.temperature_k = image.temperature_k;
    planes.depth_m = image.depth_m;
    planes.object_id = image.object_id;
    planes.metadata = {
        view.sim_time_ns, 1,           view.sensor_pose, shown.name,
        shown.lo_um,      shown.hi_um, "W m-2 sr-1",     scene::spectral_band(shown).response,
        view.fov_h_rad};
    const auto file = names_of(command_.out, plan_, camera).file(time_s, shown.name);
    if (auto done = write_frame_exr(file, planes); !done) return done;
    if (command_.png) {
      auto done = write_frame_png(
          names_of(*command_.png, plan_, camera).file(time_s, shown.name), planes,
          {scenario_.display.min_k, scenario_.display.max_k, png_quantity(command_.png_of)});
      if (!done) return done;
    }
    fmt::print(lines(),
               "{}: {}x{}, sim time {:.3f} s, {} of {} surface pixels; {}; setup {:.1f} s, history "
               "{:.1f} s, picture {:.1f} s\n",
               file.string(), image.width_px, image.height_px, time_s, image.solved_px,
               image.surface_px, model_text(), times_.setup_s, times_.history_s, times_.image_s);
    Json json = Json::object();
    json.set("file", file.string()).set("sim_time_s", time_s).set("band", shown.name);
    if (!camera.name.empty()) json.set("camera", camera.name);
    json.set("width", image.width_px).set("height", image.height_px);
    json.set("surface_px", image.surface_px).set("solved_px", image.solved_px);
    json.set("picture_s", times_.image_s);
    pictures_.push_back(std::move(json));
  }
  return {};
}

physics::Result<void> Solving::solve_probes(double time_s) {
  if (plan_.probes.empty()) return {};
  const auto points = solver_->probe(plan_.probes, std::llround(time_s * 1e9));
  if (!points) return tl::unexpected(points.error());
  if (solver_->stopped()) return interrupted("");
  const auto lost = std::ranges::count_if(
      *points, [](const auto& point) { return !std::isfinite(point.temperature_k); });
  if (lost > 0) {
    warn(
        fmt::format("sim time {:g} s: {} of {} points of --at are farther than {} m from every "
                    "surface that they may belong to; their temperature is nan",
                    time_s, lost, points->size(), reference::kProbeReachM));
  }
  table_ += probe_rows(time_s, plan_.probes, *points, scenario_);
  return {};
}

physics::Result<void> Solving::solve_instant(double time_s) {
  const std::int64_t sim_time_ns = std::llround(time_s * 1e9);
  auto start = std::chrono::steady_clock::now();
  if (const auto reached = solver_->advance_to(sim_time_ns); !reached) return reached;
  times_.history_s += seconds_since(start);
  if (solver_->stopped()) {
    return interrupted(command_.checkpoint ? "; run again to go on from the checkpoint" : "");
  }
  if (auto done = solve_probes(time_s); !done) return done;
  for (const SolveCamera& camera : plan_.cameras) {
    const auto view = view_of(camera, scenario_, sim_time_ns);
    if (!view) return tl::unexpected(view.error());
    start = std::chrono::steady_clock::now();
    const auto image = solver_->image(*view);
    if (!image) return tl::unexpected(image.error());
    times_.image_s = seconds_since(start);
    if (solver_->stopped()) return interrupted("");
    check_view(camera, time_s, *image);
    if (auto done = write_picture(camera, time_s, *view, *image); !done) return done;
  }
  return {};
}

physics::Result<void> Solving::write_tables() const {
  if (command_.at) {
    auto file = ReplacingFile::create(command_.at_out);
    if (!file) return tl::unexpected(std::move(file.error()));
    if (auto done = file->write(probe_header() + table_); !done) return done;
    if (auto done = file->commit(); !done) return done;
  }
  if (!command_.json) return {};
  const reference::SolveReport report = solver_->report();
  Json json = Json::object();
  json.set("scenario", scenario_.name).set("sim_time_s", plan_.times_s.back());
  json.set("dimension", report.dimension).set("reason", report.reason);
  json.set("refine", command_.refine).set("rays", command_.rays);
  json.set("tolerance_k", command_.tolerance_k).set("spin_up_s", report.spin_up_s);
  json.set("nodes", report.nodes).set("faces", report.faces).set("patches", report.patches);
  json.set("resumed", report.resumed);
  json.set("history", stats_json(report.stats)).set("spin_up", stats_json(report.spin_up));
  json.set("setup_s", times_.setup_s).set("history_s", times_.history_s);
  // One picture has its keys beside those of the run. `pictures` has those of every picture.
  if (pictures_.size() == 1) json.merge(pictures_.front());
  Json pictures = Json::array();
  for (const Json& picture : pictures_) pictures.push(picture);
  json.set("pictures", std::move(pictures));
  return write_json(*command_.json, json);
}

physics::Result<void> Solving::run(const scene::SceneGeometry& geometry) {
  const InterruptGuard interrupts;
  Progress bar("solve", kShareParts);
  const auto start = std::chrono::steady_clock::now();
  reference::SolveOptions options = solver_options(command_, bar);
  options.first_ns = std::llround(plan_.times_s.front() * 1e9);
  auto solver = reference::SceneSolver::create(scenario_, geometry, options,
                                               std::llround(plan_.times_s.back() * 1e9));
  if (!solver) return tl::unexpected(std::move(solver.error()));
  solver_.emplace(std::move(*solver));
  times_.setup_s = seconds_since(start);
  std::size_t told = 0;
  const auto tell = [&] {
    const std::vector<std::string> notes = solver_->report().notes;
    for (; told < notes.size(); ++told) warn(notes[told]);
  };
  tell();
  for (const double time_s : plan_.times_s) {
    if (auto done = solve_instant(time_s); !done) return done;
    tell();
  }
  return write_tables();
}

int run(const SolveOptions& command) {
  if (command.out.empty() && !command.at) {
    return fail(kExitUsage, "nothing to solve: give --out, --at or both");
  }
  if (command.out.empty() && (command.png || !command.cameras.empty())) {
    return fail(kExitUsage, "--png and --camera need --out");
  }
  if (command.at_out != "-" && !command.at) return fail(kExitUsage, "--at-out needs --at");
  for (const auto& [name, format, file] :
       {std::tuple{"--out", ImageFormat::exr, std::optional(command.out)},
        std::tuple{"--png", ImageFormat::png, command.png}}) {
    if (!file || file->empty()) continue;
    if (auto good = check_image_name(*file, format); !good) {
      return fail(kExitUsage, std::move(good.error()).with_context(name).text);
    }
  }
  const auto scenario = load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  const auto plan = make_plan(command, *scenario);
  if (!plan) return fail(kExitUsage, plan.error().text);
  if (auto writable = check_pictures(command, *plan, *scenario); !writable) {
    return fail(writable.error());
  }
  auto geometry = scene::load_scene(*scenario);
  if (!geometry) return fail_config(geometry.error());
  scene::adopt_sheets(*geometry);
  for (const std::string& text : scenario->warnings) warn(text);
  for (const std::string& text : geometry->warnings) warn(text);
  if (std::ranges::any_of(scenario->materials, [](const scene::Material& material) {
        return material.clutter.has_value();
      })) {
    warn("[[clutter]] is ignored by emit solve: materials are those of its mean");
  }
  if (!scenario->gas.empty()) warn("plumes, flares, smoke and fires are not drawn by emit solve");
  std::optional<tbb::global_control> threads;
  if (command.threads > 0) {
    threads.emplace(tbb::global_control::max_allowed_parallelism,
                    static_cast<std::size_t>(command.threads));
  }
  if (auto done = Solving(command, *scenario, *plan).run(*geometry); !done) {
    return fail(done.error());
  }
  return kExitOk;
}

void add_options(CommandLine& line, SolveOptions& options) {
  add_scenario(line, options.input, "scenario");
  add_times(line, "emit solve", options.times, "repeatable: one history gives all");
  line.path("--out", options.out,
            "OpenEXR file to write. {time}, {band} and {camera} in the name stand for those of the "
            "picture; without them several add _t<time>, _<band> and _<camera> before the "
            "extension");
  line.path("--png", options.png, "False-colour image as PNG; the name is made as that of --out");
  add_png_of(line, options.png_of, true);
  line.option("--camera", options.cameras,
              "Camera NAME=x,y,z,to_x,to_y,to_z[,fov_deg] in place of the sensor's pose, m; "
              "repeatable")
      .repeatable()
      .type_name("CAMERA");
  line.path("--at", options.at,
            "CSV table of points x_m,y_m,z_m, optionally with nx,ny,nz and object, whose surface "
            "temperatures are wanted");
  line.output_file("--at-out", options.at_out,
                   "CSV table of their temperatures; -: standard output")
      .show_default();
  line.option("--dimension", options.dimension,
              "Conduction: 3 (solids and sheets of axis-aligned faces, nothing moving), 1 (behind "
              "every pixel), auto (3 where it fits; the result says why)")
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
  line.option("--spin-up-h", options.spin_up_h,
              "Least length of the shaded history before the scenario's own, h; none where "
              "thermal.spin_up_s is 0")
      .in_range(0.0, 8784.0)
      .show_default();
  line.count("--pixels", options.pixels,
             "Only so many surface pixels, always the same ones, the rest NaN; 0: all");
  line.output_folder("--checkpoint", options.checkpoint,
                     "Folder to save the three-dimensional history in, and to go on from");
  line.option("--threads", options.threads, "Threads; 0: one per core").show_default();
  line.option("--band", options.bands,
              "Band of the radiance channel; repeatable: a file for each; default: the first")
      .repeatable()
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
