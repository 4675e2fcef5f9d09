// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>

#include "bench/accuracy/embree_yardstick.hpp"
#include "bench/frame_time/frame_time_benches.hpp"
#include "bench/frame_time/paper_errors.hpp"
#include "bench/frame_time/paper_run.hpp"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

struct PaperOptions {
  std::optional<std::filesystem::path> json;
  std::vector<std::string> scenes;
  std::vector<std::uint32_t> steps;
  PaperFrames frames;
  std::vector<std::string> methods{"per-frame", "cached"};
  std::string model;  ///< empty: emit2014
  bool no_errors = false;
  std::uint32_t pixels = 20'000;
};

using physics::Result;

/// Frame rate that `time_scale` refers to.
constexpr double kNominalRateHz = 200.0;

/// One line of the result.
struct Row {
  std::string scene;
  std::uint32_t steps = 0;
  PaperRun run;
  PaperTimes free_run;
  PaperTimes serial;
  std::optional<PaperErrors> errors;
  std::string reference;
  Samples embree_step_ms;
  SceneFill fill;

  /// Returns the ratio of the frame time to the time that Embree takes for the steps alone; empty
  /// without sun.
  [[nodiscard]] std::optional<double> embree_ratio() const {
    if (embree_step_ms.empty()) return std::nullopt;
    return free_run.frame_ms.median() / (steps * embree_step_ms.median());
  }
  [[nodiscard]] double serial_ms() const {
    double sum_ms = 0.0;
    for (const Samples& stage : serial.stages_ms) sum_ms += stage.mean();
    return sum_ms;
  }
};

/// The published method is a yardstick only while it is not needlessly slow.
bool baseline_is_slow(const Row& row) {
  return row.run.method.method == scene::ThermalMethod::per_frame &&
         row.embree_ratio().value_or(0.0) > kMaxEmbreeRatio;
}

void set_errors(const Row& row, Json& json) {
  const auto number = [](const ErrorSummary& summary, double value) {
    return summary.pixels > 0 ? Json(value) : Json(nullptr);
  };
  if (row.errors) {
    const ErrorSummary& surface = row.errors->surface;
    json.set("max_error_k", number(surface, surface.max));
    json.set("rms_error_k", number(surface, surface.rms));
    json.set("p99_error_k", number(surface, surface.p99));
    json.set("edge_p99_k", number(row.errors->outline, row.errors->outline.p99));
    json.set("pixels_compared", surface.pixels).set("reference", row.reference);
    json.set("mean_error_k", number(surface, surface.mean));
    json.set("edge_pixels", row.errors->outline.pixels);
    json.set("not_finite_px", surface.not_finite + row.errors->outline.not_finite);
  } else {
    for (const char* key :
         {"max_error_k", "rms_error_k", "p99_error_k", "edge_p99_k", "pixels_compared", "reference",
          "mean_error_k", "edge_pixels", "not_finite_px"}) {
      json.set(key, nullptr);
    }
  }
}

Json row_json(const Row& row, bool asked_enough) {
  static constexpr std::array<const char*, 6> kStages{"geometry", "occlusion", "shadow",
                                                      "thermal",  "radiance",  "readback"};
  Json stages = Json::object();
  for (std::size_t i = 0; i < kStages.size(); ++i) {
    stages.set(kStages[i], row.serial.stages_ms[i].mean());
  }
  const PaperRun& run = row.run;
  const double advance_s = 1e-9 * static_cast<double>(run.advance_ns);
  Json json = Json::object();
  json.set("scene", row.scene).set("steps", row.steps).set("method", run.method.name);
  const bool foster = run.scenario.thermal.model == scene::ThermalModel::foster;
  json.set("model", foster ? "foster" : "emit2014");
  json.set("frame_ms_median", row.free_run.frame_ms.median());
  json.set("frame_ms_mean", row.free_run.frame_ms.mean());
  json.set("frame_ms_p99", row.free_run.frame_ms.percentile(0.99));
  json.set("frame_ms_max", row.free_run.frame_ms.max());
  json.set("stages_ms", std::move(stages)).set("frame_serial_ms", row.serial_ms());
  json.set("frame_serial_wall_ms", row.serial.frame_ms.mean());
  json.set("time_scale", advance_s * kNominalRateHz);
  set_errors(row, json);
  const auto ratio = row.embree_ratio();
  json.set("embree_step_ms_median", ratio ? Json(row.embree_step_ms.median()) : Json(nullptr));
  json.set("embree_ratio", ratio ? Json(*ratio) : Json(nullptr));
  json.set("frames", run.frames).set("triangles", row.free_run.triangles);
  json.set("width", run.scenario.sensor.width_px).set("height", run.scenario.sensor.height_px);
  const bool uniform = row.run.scenario.thermal.spacing == scene::StepSpacing::uniform;
  json.set("spacing", uniform ? "uniform" : "geometric").set("camera_px_per_frame", kPaperPanPx);
  json.set("nominal_rate_hz", kNominalRateHz).set("sim_advance_s_per_frame", advance_s);
  json.set("newest_interval_closings", kPaperClosings);
  const bool statue = row.scene == "statue";
  json.set("surface_fill_frac", row.fill.surface_frac);
  json.set("statue_fill_frac", statue ? Json(row.fill.figure_frac) : Json(nullptr));
  json.set("swept_ground_frac", row.fill.swept_ground_frac);
  json.set("rules_met",
           asked_enough && broken_rules(row.fill, statue).empty() && !baseline_is_slow(row));
  return json;
}

std::vector<std::string> table_line(const Row& row) {
  const auto ms = [](double value) { return fmt::format("{:.1f}", value); };
  const auto kelvin = [](const ErrorSummary& summary, double value) {
    return summary.pixels > 0 ? fmt::format("{:.3f}", value) : std::string("-");
  };
  std::vector<std::string> line{row.scene, fmt::format("{}", row.steps), row.run.method.name,
                                ms(row.free_run.frame_ms.median()),
                                ms(row.free_run.frame_ms.max())};
  for (const Samples& stage : row.serial.stages_ms) line.push_back(ms(stage.mean()));
  line.push_back(ms(row.serial_ms()));
  line.push_back(fmt::format("{:.0f} %", 100.0 * row.fill.surface_frac));
  const PaperErrors errors = row.errors.value_or(PaperErrors{});
  line.push_back(kelvin(errors.surface, errors.surface.rms));
  line.push_back(kelvin(errors.surface, errors.surface.p99));
  line.push_back(kelvin(errors.surface, errors.surface.max));
  line.push_back(kelvin(errors.outline, errors.outline.p99));
  const auto ratio = row.embree_ratio();
  line.push_back(ratio ? ms(row.embree_step_ms.median()) : "-");
  line.push_back(ratio ? fmt::format("{:.3g}", *ratio) : "-");
  return line;
}

bool wanted(const PaperMethod& method, const PaperOptions& command) {
  return std::ranges::find(command.methods, method.name) != command.methods.end();
}

/// Runs all methods and step counts of one scene.
Result<void> run_scene(const std::string& name, const scene::ScenarioDesc& scenario,
                       std::span<const std::uint32_t> steps, const PaperOptions& command,
                       const PaperProgress& progress, std::vector<Row>& rows) {
  // The shares depend on camera and sun, not on the number of steps, so the cheapest run is
  // measured.
  const PaperRun cheapest = make_paper_run(
      scenario, kPaperMethods[0], *std::min_element(steps.begin(), steps.end()), command.frames);
  const auto fill = check_fill(cheapest);
  if (!fill) return tl::unexpected(fill.error());
  for (const std::string& text : broken_rules(*fill, name == "statue")) {
    warn(fmt::format("{}: {}", name, text));
  }
  const auto view = first_view(cheapest);
  if (!view) return tl::unexpected(view.error());
  const auto yardstick = EmbreeYardstick::create(cheapest.scenario, *view);
  if (!yardstick) return tl::unexpected(yardstick.error());
  std::optional<PaperReference> reference;
  if (!command.no_errors) {
    auto created = PaperReference::create(cheapest.scenario, name, command.pixels);
    if (!created) return tl::unexpected(std::move(created.error()));
    reference.emplace(std::move(*created));
  }
  for (const std::uint32_t count : steps) {
    for (const PaperMethod& method : kPaperMethods) {
      if (!wanted(method, command)) continue;
      Row row;
      row.scene = name;
      row.steps = count;
      row.fill = *fill;
      row.run = make_paper_run(scenario, method, count, command.frames);
      for (const bool stages : {false, true}) {
        auto times = time_frames(row.run, stages, progress);
        if (!times) return tl::unexpected(std::move(times.error()));
        (stages ? row.serial : row.free_run) = std::move(*times);
      }
      row.embree_step_ms = yardstick->step_ms(count);
      if (reference) {
        const auto frames = judged_frames(row.run);
        if (!frames) return tl::unexpected(frames.error());
        const auto errors = reference->judge(*frames);
        if (!errors) return tl::unexpected(errors.error());
        row.errors = *errors;
        row.reference = reference->describe();
      }
      if (baseline_is_slow(row)) {
        warn(
            fmt::format("{}: a {} frame of {} steps takes {:.1f} times what Embree takes for the "
                        "steps, the rule is {:.0f} times",
                        name, method.name, count, *row.embree_ratio(), kMaxEmbreeRatio));
      }
      rows.push_back(std::move(row));
    }
  }
  return {};
}

int run(const PaperOptions& command) {
  const std::vector<std::string> scenes =
      command.scenes.empty() ? std::vector<std::string>{"box", "statue"} : command.scenes;
  const std::vector<std::uint32_t> steps =
      command.steps.empty() ? std::vector<std::uint32_t>{27, 90} : command.steps;
  const auto too_little =
      broken_rules(command.frames.width_px, command.frames.height_px,
                   command.no_errors ? std::nullopt : std::optional(command.pixels));
  for (const std::string& text : too_little) warn(text);
  const InterruptGuard interrupt;
  std::uint64_t frames = 0;
  for (const PaperMethod& method : kPaperMethods) {
    if (!wanted(method, command)) continue;
    frames += 2 * (std::uint64_t{std::max(command.frames.frames, method.least_frames)} + 1);
  }
  Progress progress("bench paper", scenes.size() * steps.size() * frames);
  std::uint64_t done = 0;
  std::vector<Row> rows;
  for (const std::string& scene : scenes) {
    // The model is the paper's own, whatever the scenarios say.
    const std::string model = command.model.empty() ? "emit2014" : command.model;
    const std::vector<std::string> overrides{"thermal.model=\"" + model + "\""};
    const auto scenario = load_scenario_choice({scene, overrides});
    if (!scenario) return fail_config(scenario.error());
    if (auto ran = run_scene(
            scene, *scenario, steps, command, [&] { progress.advance_to(++done); }, rows);
        !ran) {
      return fail(ran.error());
    }
  }
  progress.finish();
  const std::string device = rows[0].free_run.device;
  TextTable table({"scene", "steps", "method", "median ms", "max ms", "geometry", "occlusion",
                   "shadow", "thermal", "radiance", "readback", "serial ms", "fill", "rms K",
                   "p99 K", "max K", "edge p99", "Embree step ms", "x Embree"});
  Json results = Json::array();
  for (const Row& row : rows) {
    table.add(table_line(row));
    results.push(row_json(row, too_little.empty()));
  }
  if (command.json != std::filesystem::path("-")) {
    fmt::print("{}, commit {}, {}x{}\n{}", device, kCommit, command.frames.width_px,
               command.frames.height_px, table.to_string());
    if (!rows[0].reference.empty()) fmt::print("errors against {}\n", rows[0].reference);
  }
  if (command.json) {
    Json json = Json::object();
    json.set("device", device).set("commit", kCommit).set("suite", "paper");
    json.set("results", std::move(results));
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  return kExitOk;
}

void add_options(CommandLine& line, PaperOptions& options) {
  line.option("--scene", options.scenes, "box or statue; repeatable; default both").repeatable();
  line.option("--steps", options.steps, "History steps; repeatable; default 27 and 90")
      .repeatable()
      .positive();
  line.option("--frames", options.frames.frames,
              "Frames per result, at least 5; cached takes at least 300")
      .in_range(5U, 100000U)
      .show_default();
  add_image_size(line, options.frames.width_px, options.frames.height_px);
  line.option("--method", options.methods, "Thermal method; repeatable; default both")
      .repeatable()
      .one_of({"per-frame", "cached"})
      .show_default();
  line.option("--model", options.model, "Thermal model; default emit2014, the paper's own")
      .one_of({"emit2014", "foster"});
  line.option(
          "--pixels", options.pixels,
          "Surface pixels per picture whose error is computed; published figures: 20000 or more")
      .in_range(1U, 100'000'000U)
      .show_default();
  line.flag("--no-errors", options.no_errors, "Times only: spares the reference");
  add_gpu(line, options.frames.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_bench_paper(CommandLine& bench) {
  bench.command<PaperOptions>(
      {.name = "paper",
       .text = "Scenes and step counts of the published tables, 1024x768",
       .example = "emit bench paper --json paper.json --scene box --steps 27"},
      add_options, run);
}

}  // namespace emit::tool
