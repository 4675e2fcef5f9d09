// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
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

struct ClutterOptions {
  std::optional<std::filesystem::path> json;
  std::string scenario = "airfield";
  std::vector<std::string> set;
  double time_s = 0.0;
  std::uint32_t pairs = 45;
  int gpu_index = -1;
};

/// Variation that is measured where the scenario has none of its own.
scene::Clutter usual_clutter() {
  scene::Clutter out;
  out.solar_absorptance_sd_frac = 0.02;
  out.inertia_sd_ln = 0.1;
  return out;
}

/// Scenes with clutter: as the scenario has it, of all materials, and of their emissivity alone.
std::vector<SceneVariant> variants_of(const scene::ScenarioDesc& loaded) {
  std::vector<SceneVariant> out;
  const bool varies = std::ranges::any_of(loaded.materials, [](const scene::Material& material) {
    return material.clutter.has_value();
  });
  if (varies) out.push_back({"as in the scenario", loaded});
  for (const bool heat : {false, true}) {
    SceneVariant& variant =
        out.emplace_back(heat ? "all materials" : "emissivity of all materials", loaded);
    for (scene::Material& material : variant.scenario.materials) {
      material.clutter = usual_clutter();
      if (heat) continue;
      material.clutter->solar_absorptance_sd_frac = material.clutter->inertia_sd_ln = 0.0;
      for (const scene::SpectralBand& band : variant.scenario.bands) {
        material.clutter->band_emissivity_sd_frac.push_back({band.name, 0.005});
      }
    }
  }
  return out;
}

int run(const ClutterOptions& command) {
  const InterruptGuard interrupt;
  const auto loaded = load_scenario_choice({command.scenario, command.set});
  if (!loaded) return fail(loaded.error());
  scene::ScenarioDesc even = *loaded;
  for (scene::Material& material : even.materials) material.clutter.reset();
  const std::vector<SceneVariant> variants = variants_of(*loaded);
  const auto measured = compare_variants(
      even, variants, {"bench clutter", command.time_s, command.pairs, command.gpu_index});
  if (!measured) return fail(measured.error());
  TextTable table({"clutter", "median ms", "max ms", "ratio", "spread", "warm-up s"});
  Json results = Json::array();
  for (std::size_t i = 0; i < measured->times.size(); ++i) {
    const VariantTimes& times = measured->times[i];
    const std::string name = i == 0 ? "none" : variants[i - 1].name;
    table.add(
        {name, fmt::format("{:.2f}", times.frame_ms.median()),
         fmt::format("{:.2f}", times.frame_ms.max()), fmt::format("{:.3f}", times.pairs.ratio),
         fmt::format("{:.3f}", times.pairs.self_spread), fmt::format("{:.1f}", times.warm_up_s)});
    Json json = Json::object();
    json.set("clutter", name).set("frames", times.frame_ms.count());
    json.set("frame_ms_median", times.frame_ms.median()).set("frame_ms_max", times.frame_ms.max());
    json.set("ratio", times.pairs.ratio).set("self_ratio", times.pairs.self_ratio);
    json.set("self_ratio_spread", times.pairs.self_spread).set("warm_up_s", times.warm_up_s);
    results.push(std::move(json));
  }
  fmt::print(text_stream(command.json), "{}, commit {}\n{}", measured->device, kCommit,
             table.to_string());
  if (command.json) {
    Json json = Json::object();
    json.set("device", measured->device).set("commit", kCommit).set("suite", "clutter");
    json.set("scenario", command.scenario).set("time_s", command.time_s);
    json.set("results", std::move(results));
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  return kExitOk;
}

void add_options(CommandLine& line, ClutterOptions& options) {
  line.option("--scenario", options.scenario, "Scenario whose materials vary").show_default();
  add_set(line, options.set);
  line.option("--time-s", options.time_s, "Simulation time of the first frame, s")
      .in_range(0.0, 1e6)
      .show_default();
  line.option("--pairs", options.pairs, "Frames with and without clutter that are shown in turn")
      .in_range(15U, 100'000U)
      .show_default();
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_bench_clutter(CommandLine& bench) {
  bench.command<ClutterOptions>(
      {.name = "clutter",
       .text = "What materials that vary from place to place add to the frame time and to the "
               "warm-up",
       .example = "emit bench clutter --json clutter.json"},
      add_options, run);
}

}  // namespace emit::tool
