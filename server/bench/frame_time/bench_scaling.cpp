// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "bench/frame_time/frame_time_benches.hpp"
#include "bench/frame_time/paired_frames.hpp"
#include "bench/frame_time/scaling_axes.hpp"
#include "bench/stability/bench_stability_scene.hpp"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {
namespace {

struct ScalingOptions {
  std::optional<std::filesystem::path> json;
  std::vector<std::string> axes;     ///< of scaling_axes(); empty: all
  std::vector<std::string> methods;  ///< empty: both
  bool quick = false;
  std::uint32_t pairs = 45;
  std::uint32_t per_frame_frames = 3;
  int gpu_index = -1;
};

using physics::Result;

/// One line of the result.
struct Row {
  std::string axis;
  double value = 0.0;
  const char* method = "cached";
  scene::ScenarioDesc scenario;
  Samples frame_ms;
  renderer::SceneStats stats;
  std::string device;
  double warm_up_s = 0.0;
  std::optional<double> ratio_to_previous;
  std::optional<PairedRatio> pairs;  ///< cached: what that ratio comes from
  std::optional<double> limit_ratio;
};

void add_all(Samples& samples, const std::vector<double>& values) {
  for (const double value : values) samples.add(value);
}

Row row_of(const ScalingAxis& axis, const ScalingCase& made, const char* method,
           const SceneRunner& runner) {
  Row row;
  row.axis = axis.name;
  row.method = method;
  row.scenario = made.scenario;
  row.stats = runner.stats();
  row.device = runner.device();
  row.warm_up_s = runner.warm_up_s();
  row.value = axis.name == "samples" ? static_cast<double>(row.stats.samples) : made.value;
  return row;
}

/// Compares each case with the case before, which runs twice: its twin shows the noise of the
/// machine.
Result<void> run_cached(const ScalingAxis& axis, const ScalingOptions& command, Progress& progress,
                        std::uint64_t& done, std::vector<Row>& rows) {
  std::optional<SceneRunner> before;
  for (const ScalingCase& made : axis.cases) {
    auto runner = SceneRunner::start(made.scenario, SceneRunner::kSettleFrames, command.gpu_index);
    if (!runner) return tl::unexpected(std::move(runner.error()));
    Row row = row_of(axis, made, "cached", *runner);
    if (before) {
      auto twin =
          SceneRunner::start(before->scenario(), SceneRunner::kSettleFrames, command.gpu_index);
      if (!twin) return tl::unexpected(std::move(twin.error()));
      const auto rounds = take_turns({&*before, &*twin, &*runner}, command.pairs);
      if (!rounds) return tl::unexpected(rounds.error());
      const auto& [a_ms, twin_ms, b_ms] = *rounds;
      add_all(rows[rows.size() - 1].frame_ms, a_ms);
      add_all(row.frame_ms, b_ms);
      row.pairs = paired_ratio(a_ms, twin_ms, b_ms);
      row.ratio_to_previous = row.pairs->ratio;
      row.limit_ratio = axis.limit_ratio;
    }
    before = std::move(*runner);
    rows.push_back(std::move(row));
    progress.advance_to(++done);
  }
  return {};
}

/// Adds a few frames of the published method.
Result<void> run_per_frame(const ScalingAxis& axis, const ScalingOptions& command,
                           Progress& progress, std::uint64_t& done, std::vector<Row>& rows) {
  std::optional<double> before_ms;
  for (const ScalingCase& made : axis.cases) {
    scene::ScenarioDesc scenario = made.scenario;
    scenario.thermal.method = scene::ThermalMethod::per_frame;
    auto runner = SceneRunner::start(scenario, 1, command.gpu_index);
    if (!runner) return tl::unexpected(std::move(runner.error()));
    Row row = row_of(axis, made, "per-frame", *runner);
    for (std::uint32_t i = 0; i < command.per_frame_frames; ++i) {
      const auto frame_ms = runner->frame_ms();
      if (!frame_ms) return tl::unexpected(frame_ms.error());
      row.frame_ms.add(*frame_ms);
    }
    if (before_ms) row.ratio_to_previous = row.frame_ms.median() / *before_ms;
    before_ms = row.frame_ms.median();
    rows.push_back(std::move(row));
    progress.advance_to(++done);
  }
  return {};
}

Json optional_number(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json row_json(const Row& row) {
  const bool cached = std::string_view(row.method) == "cached";
  Json json = Json::object();
  json.set("axis", row.axis).set("value", row.value).set("method", row.method);
  json.set("frame_ms_median", row.frame_ms.median()).set("frame_ms_max", row.frame_ms.max());
  json.set("frames", row.frame_ms.count());
  json.set("ratio_to_previous", optional_number(row.ratio_to_previous));
  json.set("pairs", row.pairs ? Json(row.pairs->pairs) : Json(nullptr));
  json.set("self_ratio", row.pairs ? Json(row.pairs->self_ratio) : Json(nullptr));
  json.set("self_ratio_spread", row.pairs ? Json(row.pairs->self_spread) : Json(nullptr));
  json.set("limit_ratio", optional_number(row.limit_ratio));
  json.set("limit_met", row.pairs && row.limit_ratio ? Json(row.pairs->within(*row.limit_ratio))
                                                     : Json(nullptr));
  json.set("scene", row.scenario.name).set("steps", row.scenario.thermal.steps);
  json.set("triangles", row.stats.triangles).set("instances", row.stats.instances);
  json.set("width", row.scenario.sensor.width_px).set("height", row.scenario.sensor.height_px);
  json.set("tolerance_k", row.scenario.thermal.tolerance_k);
  json.set("samples", cached ? Json(row.stats.samples) : Json(nullptr));
  json.set("samples_full", cached ? Json(row.stats.samples_full) : Json(nullptr));
  json.set("warm_up_s", cached ? Json(row.warm_up_s) : Json(nullptr));
  json.set("rate_hz", SceneRunner::kRateHz);
  return json;
}

std::vector<std::string> table_line(const Row& row) {
  std::vector<std::string> line{row.axis, fmt::format("{:.0f}", row.value), row.method,
                                fmt::format("{:.2f}", row.frame_ms.median()),
                                fmt::format("{:.2f}", row.frame_ms.max())};
  const auto ratio = [](double value) { return fmt::format("{:.3f}", value); };
  line.push_back(row.ratio_to_previous ? ratio(*row.ratio_to_previous) : "-");
  line.push_back(row.pairs ? ratio(row.pairs->self_spread) : "-");
  line.push_back(row.limit_ratio ? ratio(*row.limit_ratio) : "-");
  const bool judged = row.pairs && row.limit_ratio;
  line.push_back(!judged ? "-" : row.pairs->within(*row.limit_ratio) ? "yes" : "NO");
  line.push_back(fmt::format("{}", row.stats.samples));
  line.push_back(fmt::format("{:.1f}", row.warm_up_s));
  return line;
}

bool wanted(const std::vector<std::string>& choice, const std::string& name) {
  return choice.empty() || std::ranges::find(choice, name) != choice.end();
}

Result<void> run_axes(const ScalingOptions& command, std::vector<Row>& rows) {
  const TemporaryFolder folder;
  if (folder.path().empty()) {
    return physics::make_error(physics::ErrorCode::io, "cannot create a temporary folder");
  }
  std::vector<ScalingAxis> axes;
  std::uint64_t cases = 0;
  for (const std::string& name : scaling_axes()) {
    if (!wanted(command.axes, name)) continue;
    auto axis = make_scaling_axis(name, command.quick, folder.path());
    if (!axis) return tl::unexpected(std::move(axis.error()));
    cases += axis->cases.size() * (name == "samples" ? 1 : 2);
    axes.push_back(std::move(*axis));
  }
  Progress progress("bench scaling", cases);
  std::uint64_t done = 0;
  for (const ScalingAxis& axis : axes) {
    if (wanted(command.methods, "cached")) {
      if (auto ran = run_cached(axis, command, progress, done, rows); !ran) return ran;
    }
    if (wanted(command.methods, "per-frame") && axis.name != "samples") {
      if (auto ran = run_per_frame(axis, command, progress, done, rows); !ran) return ran;
    }
  }
  return {};
}

int run(const ScalingOptions& command) {
  const InterruptGuard interrupt;
  std::vector<Row> rows;
  if (const auto ran = run_axes(command, rows); !ran) return fail(ran.error());
  TextTable table({"axis", "value", "method", "median ms", "max ms", "x previous", "self spread",
                   "limit", "met", "samples", "warm-up s"});
  Json results = Json::array();
  for (const Row& row : rows) {
    table.add(table_line(row));
    results.push(row_json(row));
  }
  if (rows.empty()) {
    return fail_call(physics::Error{physics::ErrorCode::invalid_argument,
                                    "no such axis for that method: per-frame has no samples"});
  }
  fmt::print(text_stream(command.json), "{}, commit {}\n{}", rows[0].device, kCommit,
             table.to_string());
  if (command.json) {
    Json json = Json::object();
    json.set("device", rows[0].device).set("commit", kCommit).set("suite", "scaling");
    json.set("results", std::move(results));
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  return kExitOk;
}

void add_options(CommandLine& line, ScalingOptions& options) {
  line.option("--axis", options.axes, "Axis; repeatable; default all")
      .repeatable()
      .one_of(scaling_axes());
  line.option("--method", options.methods, "Thermal method; repeatable; default both")
      .repeatable()
      .one_of({"per-frame", "cached"});
  line.flag("--quick", options.quick, "Small scenes and coarse pictures, in seconds");
  line.option("--pairs", options.pairs, "cached: frames of two scenes that are shown in turn")
      .in_range(15U, 100'000U)
      .show_default();
  line.option("--per-frame-frames", options.per_frame_frames, "per-frame: frames timed per scene")
      .in_range(1U, 100'000U)
      .show_default();
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_bench_scaling(CommandLine& bench) {
  bench.command<ScalingOptions>(
      {.name = "scaling",
       .text =
           "How frame time grows with history steps, triangles, pixels, objects out of view and "
           "thermal samples",
       .example = "emit bench scaling --json scaling.json --axis steps"},
      add_options, run);
}

}  // namespace emit::tool
