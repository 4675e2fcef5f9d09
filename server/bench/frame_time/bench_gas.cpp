// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bench/frame_time/frame_time_benches.hpp"
#include "bench/frame_time/paired_frames.hpp"
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

using physics::Result;

struct GasOptions {
  std::optional<std::filesystem::path> json;
  std::string scenario = "decoys";
  std::vector<std::string> set;
  double time_s = 2.6;
  std::uint32_t pairs = 45;
  int gpu_index = -1;
};

/// One kind of gas, beside the scene without any.
struct Row {
  std::string gas;
  std::size_t puffs = 0;
  Samples frame_ms;
  PairedRatio pairs;
};

/// Kinds of gas that are measured alone, and all of it.
struct Kind {
  const char* name;
  void (*keep)(const scene::GasDesc& all, scene::GasDesc& out);
};
constexpr Kind kKinds[] = {
    {"plumes", [](const scene::GasDesc& all, scene::GasDesc& out) { out.plumes = all.plumes; }},
    {"flares", [](const scene::GasDesc& all, scene::GasDesc& out) { out.flares = all.flares; }},
    {"smoke", [](const scene::GasDesc& all, scene::GasDesc& out) { out.smokes = all.smokes; }},
    {"fires", [](const scene::GasDesc& all, scene::GasDesc& out) { out.fires = all.fires; }},
    {"all", [](const scene::GasDesc& all, scene::GasDesc& out) { out = all; }},
};

Result<SceneRunner> runner_of(const GasOptions& command, const scene::ScenarioDesc& scenario,
                              std::uint32_t first_frame) {
  auto runner = SceneRunner::start(scenario, SceneRunner::kSettleFrames, command.gpu_index);
  if (runner) runner->skip_to(first_frame);
  return runner;
}

Result<std::vector<Row>> measure(const GasOptions& command, std::string& device) {
  const auto loaded = load_scenario_choice({command.scenario, command.set});
  if (!loaded) return tl::unexpected(loaded.error());
  scene::ScenarioDesc bare = *loaded;
  bare.gas = {};
  Progress progress("bench gas", std::size(kKinds));
  // The scene without gas and its twin are the same for all kinds.
  std::vector<SceneRunner> still;
  const auto first_frame = static_cast<std::uint32_t>(command.time_s * SceneRunner::kRateHz);
  for (int i = 0; i < 2; ++i) {
    auto runner = runner_of(command, bare, first_frame);
    if (!runner) return tl::unexpected(std::move(runner.error()));
    still.push_back(std::move(*runner));
  }
  device = still[0].device();
  std::vector<Row> rows;
  for (const Kind& kind : kKinds) {
    scene::ScenarioDesc with = bare;
    kind.keep(loaded->gas, with.gas);
    progress.advance_to(rows.size() + 1);
    if (with.gas.empty()) continue;
    auto runner = runner_of(command, with, still[0].next_frame());
    if (!runner) return tl::unexpected(std::move(runner.error()));
    const auto rounds = take_turns({&still[0], &still[1], &*runner}, command.pairs);
    if (!rounds) return tl::unexpected(rounds.error());
    const auto& [bare_ms, twin_ms, with_ms] = *rounds;
    if (rows.empty()) {
      Row& row = rows.emplace_back();
      row.gas = "none";
      for (const double ms : bare_ms) row.frame_ms.add(ms);
      row.pairs = {.pairs = bare_ms.size(), .ratio = 1.0, .self_ratio = 1.0};
    }
    Row& row = rows.emplace_back();
    row.gas = kind.name;
    row.puffs = with.gas.puffs();
    for (const double ms : with_ms) row.frame_ms.add(ms);
    row.pairs = paired_ratio(bare_ms, twin_ms, with_ms);
  }
  return rows;
}

int run(const GasOptions& command) {
  const InterruptGuard interrupt;
  std::string device;
  const auto rows = measure(command, device);
  if (!rows) return fail(rows.error());
  TextTable table({"gas", "puffs", "median ms", "max ms", "ratio", "spread"});
  Json results = Json::array();
  for (const Row& row : *rows) {
    table.add({row.gas, fmt::format("{}", row.puffs), fmt::format("{:.2f}", row.frame_ms.median()),
               fmt::format("{:.2f}", row.frame_ms.max()), fmt::format("{:.3f}", row.pairs.ratio),
               fmt::format("{:.3f}", row.pairs.self_spread)});
    Json json = Json::object();
    json.set("gas", row.gas).set("puffs", row.puffs).set("frames", row.frame_ms.count());
    json.set("frame_ms_median", row.frame_ms.median()).set("frame_ms_max", row.frame_ms.max());
    json.set("ratio", row.pairs.ratio).set("self_ratio", row.pairs.self_ratio);
    json.set("self_ratio_spread", row.pairs.self_spread);
    results.push(std::move(json));
  }
  fmt::print(text_stream(command.json), "{}, commit {}\n{}", device, kCommit, table.to_string());
  if (command.json) {
    Json json = Json::object();
    json.set("device", device).set("commit", kCommit).set("suite", "gas");
    json.set("scenario", command.scenario).set("time_s", command.time_s);
    json.set("results", std::move(results));
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  return kExitOk;
}

void add_options(CommandLine& line, GasOptions& options) {
  line.option("--scenario", options.scenario, "Scenario with gas").show_default();
  add_set(line, options.set);
  line.option("--time-s", options.time_s, "Simulation time of the first frame, s")
      .in_range(0.0, 1e6)
      .show_default();
  line.option("--pairs", options.pairs, "Frames with and without gas that are shown in turn")
      .in_range(15U, 100'000U)
      .show_default();
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_bench_gas(CommandLine& bench) {
  bench.command<GasOptions>(
      {.name = "gas",
       .text = "What plumes, flares, smoke and fires of a scenario add to the "
               "frame time, each kind alone and all together",
       .example = "emit bench gas --json gas.json"},
      add_options, run);
}

}  // namespace emit::tool
