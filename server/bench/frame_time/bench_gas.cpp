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
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

struct GasOptions {
  std::optional<std::filesystem::path> json;
  std::string scenario = "decoys";
  std::vector<std::string> set;
  double time_s = 2.6;
  std::uint32_t pairs = 45;
  int gpu_index = -1;
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

int run(const GasOptions& command) {
  const InterruptGuard interrupt;
  const auto loaded = load_scenario_choice({command.scenario, command.set});
  if (!loaded) return fail(loaded.error());
  scene::ScenarioDesc bare = *loaded;
  bare.gas = {};
  std::vector<SceneVariant> variants;
  for (const Kind& kind : kKinds) {
    scene::ScenarioDesc with = bare;
    kind.keep(loaded->gas, with.gas);
    if (!with.gas.empty()) variants.push_back({kind.name, std::move(with)});
  }
  const auto measured = compare_variants(
      bare, variants, {"bench gas", command.time_s, command.pairs, command.gpu_index});
  if (!measured) return fail(measured.error());
  TextTable table({"gas", "puffs", "median ms", "max ms", "ratio", "spread"});
  Json results = Json::array();
  for (std::size_t i = 0; i < measured->times.size(); ++i) {
    const VariantTimes& times = measured->times[i];
    const std::string name = i == 0 ? "none" : variants[i - 1].name;
    const std::size_t puffs = i == 0 ? 0 : variants[i - 1].scenario.gas.puffs();
    table.add({name, fmt::format("{}", puffs), fmt::format("{:.2f}", times.frame_ms.median()),
               fmt::format("{:.2f}", times.frame_ms.max()),
               fmt::format("{:.3f}", times.pairs.ratio),
               fmt::format("{:.3f}", times.pairs.self_spread)});
    Json json = Json::object();
    json.set("gas", name).set("puffs", puffs).set("frames", times.frame_ms.count());
    json.set("frame_ms_median", times.frame_ms.median()).set("frame_ms_max", times.frame_ms.max());
    json.set("ratio", times.pairs.ratio).set("self_ratio", times.pairs.self_ratio);
    json.set("self_ratio_spread", times.pairs.self_spread);
    results.push(std::move(json));
  }
  fmt::print(text_stream(command.json), "{}, commit {}\n{}", measured->device, kCommit,
             table.to_string());
  if (command.json) {
    Json json = Json::object();
    json.set("device", measured->device).set("commit", kCommit).set("suite", "gas");
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
