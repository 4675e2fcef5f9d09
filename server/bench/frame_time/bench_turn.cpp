// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bench/frame_time/frame_time_benches.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/frames.hpp"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/renderer_thread.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {
namespace {

struct TurnOptions {
  std::optional<std::filesystem::path> json;
  std::string scene = "airfield";
  std::vector<std::string> set;
  std::vector<std::string> methods{"cached"};
  std::uint32_t runs = 5;
  std::uint32_t frames = 100;  ///< per turn
  double budget_frac = 1.7;    ///< of the free-running median
  std::uint32_t width_px = 640;
  std::uint32_t height_px = 512;
  int gpu_index = -1;
};

using physics::Result;

constexpr double kTurnS = 1.0;
/// Boresight below the horizon, so that ground and sky are both in the image.
constexpr double kDownRad = 5.0 * physics::kDegree;
/// Length of a jump. Each goes in another direction.
constexpr double kJumpM = 100.0;

/// One line of the result: some turns in one place, or each in a new one.
struct Row {
  const char* name = "turn";
  std::string method;
  std::optional<double> budget_ms;  ///< none: full quality, however long it takes
  Samples frame_ms;
  Samples worst_ms;  ///< of each run
  std::uint64_t coarse_frames = 0;
  std::uint64_t shed_frames = 0;
  std::uint64_t late_frames = 0;

  [[nodiscard]] double ratio() const { return worst_ms.median() / frame_ms.median(); }
};

physics::Pose looking(const glm::dvec3& eye_m, double yaw_rad) {
  const double level = std::cos(kDownRad);
  const glm::dvec3 ahead(level * std::sin(yaw_rad), level * std::cos(yaw_rad), -std::sin(kDownRad));
  return {eye_m, physics::world_from_body_look_at(eye_m, eye_m + ahead)};
}

/// A camera that turns on the spot where the scenario's flight ends, in real time.
class Turntable {
 public:
  static Result<Turntable> create(const TurnOptions& command, const std::string& method) {
    std::vector<std::string> overrides{"thermal.method=\"" + method + "\"",
                                       "thermal.model=\"foster\""};
    overrides.insert(overrides.end(), command.set.begin(), command.set.end());
    auto scenario = load_scenario_choice({command.scene, overrides});
    if (!scenario) return tl::unexpected(std::move(scenario.error()));
    scene::Trajectory& keys = scenario->sensor.trajectory;
    if (keys.empty()) {
      return physics::make_error(physics::ErrorCode::config,
                                 fmt::format("{}: the sensor has no trajectory", scenario->name));
    }
    // The renderer knows the place in advance, but not the turn.
    keys.erase(keys.begin(), keys.end() - 1);
    scenario->sensor.width_px = command.width_px;
    scenario->sensor.height_px = command.height_px;
    auto renderer = RendererThread::create(*scenario, command.gpu_index, renderer::Ladder::live);
    if (!renderer) return tl::unexpected(std::move(renderer.error()));
    return Turntable(command, *scenario, std::move(*renderer));
  }

  Result<void> warm_up() {
    const auto seconds = renderer_->warm_up(request(eye_m_, 0));
    if (!seconds) return tl::unexpected(seconds.error());
    warm_up_s_ = *seconds;
    return {};
  }

  /// Renders a full turn and adds its figures to `row`.
  Result<void> turn(const glm::dvec3& eye_m, Row& row) {
    Samples frame_ms;
    for (std::uint32_t i = 0; i < frames_; ++i) {
      const auto frame = row.budget_ms ? renderer_->render_within(request(eye_m, i), *row.budget_ms)
                                       : renderer_->render(request(eye_m, i));
      if (!frame) return tl::unexpected(frame.error());
      if (frame->quality_level > 0) ++row.shed_frames;
      if (row.budget_ms && frame->frame_ms > *row.budget_ms) ++row.late_frames;
      frame_ms.add(frame->frame_ms);
      row.frame_ms.add(frame->frame_ms);
      if (frame->coarse) ++row.coarse_frames;
      ++shown_;
    }
    row.worst_ms.add(frame_ms.max());
    return {};
  }
  /// Renders an untimed frame in the known place.
  Result<void> settle() {
    const auto frame = renderer_->render(request(eye_m_, 0));
    if (!frame) return tl::unexpected(frame.error());
    ++shown_;
    return {};
  }

  [[nodiscard]] const glm::dvec3& eye_m() const noexcept { return eye_m_; }
  [[nodiscard]] const renderer::SceneStats& stats() const noexcept { return renderer_->stats(); }
  [[nodiscard]] const std::string& device() const noexcept { return renderer_->device(); }
  [[nodiscard]] double warm_up_s() const noexcept { return warm_up_s_; }

 private:
  Turntable(const TurnOptions& command, const scene::ScenarioDesc& scenario,
            std::unique_ptr<RendererThread> renderer)
      : renderer_(std::move(renderer)),
        frames_(command.frames),
        start_ns_(observation_ns(scenario)),
        eye_m_(scenario.sensor.trajectory.front().pose.position_world_m) {}

  [[nodiscard]] renderer::FrameRequest request(const glm::dvec3& eye_m, std::uint32_t i) const {
    renderer::FrameRequest out;
    out.frame_number = shown_;
    out.sim_time_ns =
        start_ns_ + std::llround(1e9 * kTurnS * static_cast<double>(shown_) / frames_);
    out.thermal_time_ns = out.sim_time_ns;
    out.sensor_pose = looking(eye_m, 2.0 * physics::kPi * i / frames_);
    return out;
  }

  std::unique_ptr<RendererThread> renderer_;
  std::uint32_t frames_ = 0;
  std::int64_t start_ns_ = 0;
  glm::dvec3 eye_m_{0.0};
  std::uint64_t shown_ = 0;
  double warm_up_s_ = 0.0;
};

Result<void> run_method(Turntable& table, const TurnOptions& command, const std::string& method,
                        std::vector<Row>& rows) {
  Progress progress("bench turn", 4 * std::uint64_t{command.runs});
  std::uint64_t done = 0;
  const auto fly = [&](const char* name, bool jump,
                       std::optional<double> budget_ms) -> Result<Row> {
    Row row;
    row.name = name;
    row.method = method;
    row.budget_ms = budget_ms;
    for (std::uint32_t run = 0; run < command.runs; ++run) {
      const double way_rad = 2.0 * physics::kPi * run / command.runs;
      const glm::dvec3 way(std::sin(way_rad), std::cos(way_rad), 0.0);
      if (auto settled = table.settle(); !settled) return tl::unexpected(settled.error());
      auto turned = table.turn(table.eye_m() + (jump ? kJumpM : 0.0) * way, row);
      if (!turned) return tl::unexpected(turned.error());
      progress.advance_to(++done);
    }
    return row;
  };
  std::optional<double> budget_ms;
  for (const bool within : {false, true}) {
    for (const bool jump : {false, true}) {
      auto row = fly(jump ? "teleport" : "turn", jump, budget_ms);
      if (!row) return tl::unexpected(row.error());
      rows.push_back(std::move(*row));
    }
    if (!within) budget_ms = command.budget_frac * rows.front().frame_ms.median();
  }
  return {};
}

Json row_json(const Row& row, const TurnOptions& command, const Turntable& table) {
  const bool cached = row.method == "cached";
  Json json = Json::object();
  json.set("case", row.name).set("method", row.method);
  json.set("budget_ms", row.budget_ms ? Json(*row.budget_ms) : Json(nullptr));
  json.set("late_frames", row.late_frames).set("shed_frames", row.shed_frames);
  json.set("frame_ms_median", row.frame_ms.median());
  json.set("frame_ms_max_median_of_runs", row.worst_ms.median()).set("ratio", row.ratio());
  json.set("frame_ms_max", row.frame_ms.max()).set("frame_ms_p99", row.frame_ms.percentile(0.99));
  json.set("frames", row.frame_ms.count()).set("coarse_frames", row.coarse_frames);
  json.set("runs", row.worst_ms.count()).set("turn_s", kTurnS).set("scene", command.scene);
  json.set("width", command.width_px).set("height", command.height_px);
  json.set("triangles", table.stats().triangles).set("instances", table.stats().instances);
  json.set("samples", cached ? Json(table.stats().samples) : Json(nullptr));
  json.set("samples_full", cached ? Json(table.stats().samples_full) : Json(nullptr));
  json.set("warm_up_s", cached ? Json(table.warm_up_s()) : Json(nullptr));
  return json;
}

int run(const TurnOptions& command) {
  const InterruptGuard interrupt;
  TextTable text({"case", "method", "budget ms", "median ms", "worst ms, median of runs", "ratio",
                  "frames", "late", "shed", "coarse", "samples", "warm-up s"});
  Json results = Json::array();
  std::string device;
  for (const std::string& method : command.methods) {
    auto table = Turntable::create(command, method);
    if (!table) return fail(table.error());
    if (auto ready = table->warm_up(); !ready) return fail(ready.error());
    std::vector<Row> rows;
    if (auto ran = run_method(*table, command, method, rows); !ran) return fail(ran.error());
    device = table->device();
    for (const Row& row : rows) {
      text.add({row.name, method, row.budget_ms ? fmt::format("{:.2f}", *row.budget_ms) : "-",
                fmt::format("{:.2f}", row.frame_ms.median()),
                fmt::format("{:.2f}", row.worst_ms.median()), fmt::format("{:.2f}", row.ratio()),
                fmt::format("{}", row.frame_ms.count()), fmt::format("{}", row.late_frames),
                fmt::format("{}", row.shed_frames), fmt::format("{}", row.coarse_frames),
                fmt::format("{}", table->stats().samples),
                fmt::format("{:.1f}", table->warm_up_s())});
      results.push(row_json(row, command, *table));
    }
  }
  fmt::print(text_stream(command.json), "{}, commit {}, {}, {}x{}\n{}", device, kCommit,
             command.scene, command.width_px, command.height_px, text.to_string());
  if (command.json) {
    Json json = Json::object();
    json.set("device", device).set("commit", kCommit).set("suite", "turn");
    json.set("results", std::move(results));
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  return kExitOk;
}

void add_options(CommandLine& line, TurnOptions& options) {
  line.option("--scene", options.scene, "Scenario with a camera trajectory: turns at its end")
      .show_default();
  add_set(line, options.set);
  line.option("--method", options.methods, "Thermal method; repeatable")
      .repeatable()
      .one_of({"per-frame", "cached"})
      .show_default();
  line.option("--runs", options.runs, "Turns, and jumps; all after one warm-up")
      .in_range(1U, 1000U)
      .show_default();
  line.option("--frames", options.frames, "Frames per turn").in_range(2U, 100'000U).show_default();
  line.option("--budget", options.budget_frac,
              "Once more with a deadline: share of the free-running median")
      .in_range(0.01, 100.0)
      .show_default();
  add_image_size(line, options.width_px, options.height_px);
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_bench_turn(CommandLine& bench) {
  bench.command<TurnOptions>(
      {.name = "turn",
       .text = "Worst frame while the camera turns all round in a second, and after jumps to "
               "places that "
               "nobody announced",
       .example = "emit bench turn --json turn.json --set thermal.tolerance_k=0.5"},
      add_options, run);
}

}  // namespace emit::tool
