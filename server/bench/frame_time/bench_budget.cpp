// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bench/frame_time/frame_time_benches.hpp"
#include "emit/physics/apparent_temperature.hpp"
#include "emit/renderer/renderer.hpp"
#include "emit/version.hpp"
#include "pacing/quality_policy.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {
namespace {

struct BudgetOptions {
  std::optional<std::filesystem::path> json;
  std::string scene = "airfield";
  std::vector<std::string> set;
  std::vector<double> budgets{0.8, 0.6, 0.1};  ///< of the free-running median
  std::uint32_t frames = 500;
  std::uint32_t width_px = 640;
  std::uint32_t height_px = 512;
  int gpu_index = -1;
};

using physics::ErrorCode;
using physics::make_error;
using physics::Result;
using Clock = std::chrono::steady_clock;

/// Result of one flight within one budget.
struct Row {
  double budget_frac = 0.0;  ///< of the free-running median
  double budget_ms = 0.0;
  Samples frame_ms;
  std::size_t within = 0;
  Samples estimated_k;
  Samples actual_k;          ///< difference to full quality of the same frame
  std::size_t factor_2 = 0;  ///< frames whose estimate is within that of the difference
  std::size_t judged = 0;    ///< frames that shed work
  std::size_t unknown = 0;   ///< of these, without estimate
  std::vector<std::size_t> of_quality_level;
};

/// The scenario's own flight, which repeats. The thermal clock runs on.
class Flight {
 public:
  static Result<Flight> create(const BudgetOptions& command) {
    std::vector<std::string> overrides{"thermal.method=\"cached\""};
    overrides.insert(overrides.end(), command.set.begin(), command.set.end());
    auto scenario = load_scenario_choice({command.scene, overrides});
    if (!scenario) return tl::unexpected(std::move(scenario.error()));
    const scene::Trajectory& keys = scenario->sensor.trajectory;
    if (keys.size() < 2) {
      return make_error(ErrorCode::config,
                        fmt::format("{}: the sensor has no trajectory", scenario->name));
    }
    scenario->sensor.width_px = command.width_px;
    scenario->sensor.height_px = command.height_px;
    renderer::OutputOptions output;
    output.slots = 2;
    output.ladder = renderer::Ladder::live;
    auto renderer = renderer::Renderer::create(*scenario, {command.gpu_index, false}, output);
    if (!renderer) return tl::unexpected(std::move(renderer.error()));
    Flight flight;
    flight.renderer_ = std::move(*renderer);
    flight.frames_ = command.frames;
    flight.begin_ns_ = keys[0].sim_time_ns;
    flight.end_ns_ = keys[keys.size() - 1].sim_time_ns;
    for (const scene::SpectralBand& band : scenario->bands) {
      flight.apparent_.emplace_back(physics::Band{band.lo_um, band.hi_um, {}});
    }
    return flight;
  }

  Result<void> warm_up() {
    Progress bar("warm-up", kShareParts);
    const auto start = Clock::now();
    auto ready = renderer_->warm_up(request(0), share_of(bar));
    if (InterruptGuard::interrupted()) return make_error(ErrorCode::io, "interrupted");
    warm_up_s_ = std::chrono::duration<double>(Clock::now() - start).count();
    return ready;
  }

  /// Renders the flight at full quality.
  Result<Samples> free_run() {
    Samples frame_ms;
    for (std::uint32_t i = 0; i < frames_; ++i) {
      const renderer::FrameRequest wanted = request(i);
      const auto start = Clock::now();
      auto shown = render(wanted);
      if (!shown) return tl::unexpected(std::move(shown.error()));
      frame_ms.add(ms_since(start));
      release(*shown);
      ++shown_;
    }
    return frame_ms;
  }

  Result<void> run(Row& row) {
    server::QualityPolicy policy;
    const auto budget_ns = static_cast<std::int64_t>(1e6 * row.budget_ms);
    for (std::uint32_t i = 0; i < frames_; ++i) {
      renderer::FrameRequest wanted = request(i);
      const auto start = Clock::now();
      const auto quality_levels = renderer_->expected_levels(wanted);
      const std::size_t quality_level = policy.choose(quality_levels, budget_ns);
      const double expected_ms = quality_levels[quality_level].frame_ms;
      wanted.quality_level = static_cast<std::uint8_t>(quality_level);
      auto shed = render(wanted);
      if (!shed) return tl::unexpected(std::move(shed.error()));
      const double frame_ms = ms_since(start);
      policy.finished(static_cast<std::int64_t>(1e6 * frame_ms), expected_ms);
      row.frame_ms.add(frame_ms);
      if (frame_ms <= row.budget_ms) ++row.within;
      row.of_quality_level.resize(std::max(row.of_quality_level.size(), quality_levels.size()));
      ++row.of_quality_level[(*shed)->quality_level];
      if ((*shed)->quality_level > 0) {
        if (auto judged = judge(wanted, **shed, row); !judged) return judged;
      }
      release(*shed);
      ++shown_;
    }
    return {};
  }

  [[nodiscard]] double warm_up_s() const noexcept { return warm_up_s_; }
  [[nodiscard]] const std::string& device() const noexcept { return renderer_->device_name(); }
  [[nodiscard]] const renderer::SceneStats& stats() const noexcept {
    return renderer_->scene_stats();
  }

 private:
  [[nodiscard]] renderer::FrameRequest request(std::uint32_t i) const {
    const double step_ns = static_cast<double>(end_ns_ - begin_ns_) / frames_;
    renderer::FrameRequest out;
    out.frame_number = shown_;
    out.sim_time_ns = begin_ns_ + std::llround(step_ns * i);
    out.thermal_time_ns = begin_ns_ + std::llround(step_ns * static_cast<double>(shown_));
    out.sensor_pose = renderer_->scenario_sensor_pose_at(out.sim_time_ns);
    return out;
  }
  static double ms_since(Clock::time_point start) {
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  }

  Result<const renderer::FrameView*> render(const renderer::FrameRequest& wanted) {
    if (InterruptGuard::interrupted()) return make_error(ErrorCode::io, "interrupted");
    const int slot = renderer_->submit(wanted);
    if (slot < 0) return make_error(ErrorCode::internal, "the renderer has no free slot");
    slots_.push_back(static_cast<renderer::SlotIndex>(slot));
    const renderer::FrameView& view = renderer_->collect(slots_.back());
    if (view.device_failed) return make_error(ErrorCode::gpu, "the device reported an error");
    return &view;
  }
  void release(const renderer::FrameView* /*newest*/) {
    renderer_->release(slots_.back());
    slots_.pop_back();
  }

  Result<void> judge(renderer::FrameRequest wanted, const renderer::FrameView& shed, Row& row) {
    wanted.quality_level = 0;
    auto full = render(wanted);
    if (!full) return tl::unexpected(std::move(full.error()));
    double actual_k = 0.0;
    for (std::size_t band = 0; band < apparent_.size(); ++band) {
      actual_k =
          std::max(actual_k, apparent_[band].rms_difference_k((*full)->radiance_w_m2_sr[band],
                                                              shed.radiance_w_m2_sr[band]));
    }
    release(*full);
    ++row.judged;
    row.actual_k.add(actual_k);
    const auto estimated_k = static_cast<double>(shed.estimated_error_k);
    if (std::isnan(estimated_k)) {
      ++row.unknown;
      return {};
    }
    row.estimated_k.add(estimated_k);
    if (estimated_k <= 2.0 * actual_k && actual_k <= 2.0 * estimated_k) ++row.factor_2;
    return {};
  }

  std::unique_ptr<renderer::Renderer> renderer_;
  std::vector<physics::ApparentTemperature> apparent_;
  std::vector<renderer::SlotIndex> slots_;
  std::uint32_t frames_ = 0;
  std::int64_t begin_ns_ = 0;
  std::int64_t end_ns_ = 0;
  std::uint64_t shown_ = 0;
  double warm_up_s_ = 0.0;
};

Json row_json(const Row& row, const BudgetOptions& command, const Flight& flight, double free_ms) {
  Json quality_levels = Json::array();
  for (const std::size_t count : row.of_quality_level) quality_levels.push(Json(count));
  Json json = Json::object();
  json.set("scene", command.scene).set("width", command.width_px).set("height", command.height_px);
  json.set("frames", row.frame_ms.count()).set("free_running_ms_median", free_ms);
  json.set("budget_frac", row.budget_frac).set("budget_ms", row.budget_ms);
  json.set("within_frac",
           static_cast<double>(row.within) / static_cast<double>(row.frame_ms.count()));
  json.set("frame_ms_median", row.frame_ms.median()).set("frame_ms_max", row.frame_ms.max());
  json.set("shed_frames", row.judged).set("unknown_estimates", row.unknown);
  json.set("estimated_error_k_median", row.estimated_k.median());
  json.set("error_k_median", row.actual_k.median()).set("error_k_max", row.actual_k.max());
  json.set("estimate_within_factor_2_frac",
           static_cast<double>(row.factor_2) / static_cast<double>(row.judged));
  json.set("frames_of_rung", std::move(quality_levels)).set("warm_up_s", flight.warm_up_s());
  json.set("samples", flight.stats().samples);
  return json;
}

int run(const BudgetOptions& command) {
  const InterruptGuard interrupt;
  auto flight = Flight::create(command);
  if (!flight) return fail(flight.error());
  if (auto ready = flight->warm_up(); !ready) return fail(ready.error());
  const auto free = flight->free_run();
  if (!free) return fail(free.error());
  TextTable text({"budget", "ms", "within", "median ms", "worst ms", "shed", "estimate K",
                  "difference K", "within factor 2"});
  Json results = Json::array();
  Progress progress("bench budget", command.budgets.size());
  std::uint64_t done = 0;
  for (const double budget_frac : command.budgets) {
    Row row;
    row.budget_frac = budget_frac;
    row.budget_ms = budget_frac * free->median();
    if (auto ran = flight->run(row); !ran) return fail(ran.error());
    progress.advance_to(++done);
    const auto share = [](std::size_t part, std::size_t whole) {
      return fmt::format("{:.1f} %",
                         100.0 * static_cast<double>(part) / static_cast<double>(whole));
    };
    text.add({fmt::format("{}", budget_frac), fmt::format("{:.2f}", row.budget_ms),
              share(row.within, row.frame_ms.count()), fmt::format("{:.2f}", row.frame_ms.median()),
              fmt::format("{:.2f}", row.frame_ms.max()), fmt::format("{}", row.judged),
              fmt::format("{:.3f}", row.estimated_k.median()),
              fmt::format("{:.3f}", row.actual_k.median()), share(row.factor_2, row.judged)});
    results.push(row_json(row, command, *flight, free->median()));
  }
  fmt::print(text_stream(command.json),
             "{}, commit {}, {}, {}x{}, free running {:.2f} ms (median), warm-up {:.1f} s\n{}",
             flight->device(), kCommit, command.scene, command.width_px, command.height_px,
             free->median(), flight->warm_up_s(), text.to_string());
  if (command.json) {
    Json json = Json::object();
    json.set("device", flight->device()).set("commit", kCommit).set("suite", "budget");
    json.set("results", std::move(results));
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  return kExitOk;
}

void add_options(CommandLine& line, BudgetOptions& options) {
  line.option("--scene", options.scene, "Scenario with a camera trajectory").show_default();
  add_set(line, options.set);
  line.option("--budget", options.budgets,
              "Time per frame, as a part of the median at full quality; repeatable")
      .repeatable()
      .positive()
      .show_default();
  line.option("--frames", options.frames, "Frames of the flight")
      .in_range(2U, 1'000'000U)
      .show_default();
  add_image_size(line, options.width_px, options.height_px);
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_bench_budget(CommandLine& bench) {
  bench.command<BudgetOptions>(
      {.name = "budget",
       .text =
           "The scenario's flight within less time per frame than full quality takes: frames that "
           "keep to it, and what they get wrong beside what they say",
       .example = "emit bench budget --budget 0.8 --json budget.json"},
      add_options, run);
}

}  // namespace emit::tool
