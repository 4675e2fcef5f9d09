// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bench/frame_time/frame_time_benches.hpp"
#include "bench/frame_time/paired_frames.hpp"
#include "bench/stability/bench_stability_scene.hpp"
#include "emit/physics/frames.hpp"
#include "emit/scenegen/generate.hpp"
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

struct CrowdOptions {
  std::optional<std::filesystem::path> json;
  std::vector<std::string> set;
  std::uint32_t instances = 10'000;
  std::uint32_t triangles = 1000;  ///< of each, at least
  std::uint32_t pairs = 45;
  int gpu_index = -1;
};

using physics::Result;

/// Largest ratio of the frame time with the crowd to the time without it.
constexpr double kLimitRatio = 3.0;
constexpr double kFigureM = 2.0;
/// The crowd covers the southern half of the field. It begins at the western end of the row next to
/// the apron.
constexpr double kApartEastM = 9.0;
constexpr double kApartNorthM = 4.4;
constexpr double kFirstEastM = -445.0;
constexpr double kFirstNorthM = -60.0;
constexpr std::uint32_t kFiguresOfRow = 100;
constexpr double kTurnRad = 0.65;  ///< from each figure to the next

/// One line of the result.
struct Row {
  std::string scene;
  scene::ScenarioDesc scenario;
  Samples frame_ms;
  renderer::SceneStats stats;
  double setup_s = 0.0;
  double warm_up_s = 0.0;
  std::optional<PairedRatio> pairs;
};

/// Places rows of seated figures, each turned another way.
Result<scene::ObjectDesc> crowd(const CrowdOptions& command, const std::filesystem::path& folder) {
  scenegen::GenerateOptions options;
  options.kind = scenegen::SceneKind::statue;
  options.directory = folder;
  options.statue = {command.triangles, kFigureM, 0.0};
  const auto files = scenegen::generate(options);
  if (!files) return tl::unexpected(files.error());
  scene::ObjectDesc object;
  object.name = "crowd";
  object.gltf = files->files.front().path;
  for (std::uint32_t i = 0; i < command.instances; ++i) {
    physics::Pose pose;
    pose.position_world_m = {kFirstEastM + kApartEastM * (i % kFiguresOfRow),
                             kFirstNorthM - kApartNorthM * (i / kFiguresOfRow), 0.0};
    pose.world_from_body = physics::world_from_body_heading_pitch_roll(kTurnRad * i, 0.0, 0.0);
    object.instances.push_back(pose);
  }
  return object;
}

Row row_of(const char* scene, const SceneRunner& runner, const std::vector<double>& frame_ms) {
  Row row;
  row.scene = scene;
  row.scenario = runner.scenario();
  row.stats = runner.stats();
  row.setup_s = runner.setup_s();
  row.warm_up_s = runner.warm_up_s();
  for (const double ms : frame_ms) row.frame_ms.add(ms);
  return row;
}

Result<std::vector<Row>> run(const CrowdOptions& command, std::string& device) {
  const TemporaryFolder folder;
  if (folder.path().empty()) {
    return physics::make_error(physics::ErrorCode::io, "cannot create a temporary folder");
  }
  std::vector<std::string> overrides{"thermal.method=\"cached\""};
  overrides.insert(overrides.end(), command.set.begin(), command.set.end());
  auto alone = load_scenario_choice({"airfield", overrides});
  if (!alone) return tl::unexpected(std::move(alone.error()));
  scene::ScenarioDesc crowded = *alone;
  auto object = crowd(command, folder.path());
  if (!object) return tl::unexpected(std::move(object.error()));
  crowded.objects.push_back(std::move(*object));

  Progress progress("bench crowd", 4);
  std::vector<SceneRunner> runners;
  for (const scene::ScenarioDesc* scenario : {&*alone, &*alone, &crowded}) {
    auto runner = SceneRunner::start(*scenario, SceneRunner::kSettleFrames, command.gpu_index);
    if (!runner) return tl::unexpected(std::move(runner.error()));
    runners.push_back(std::move(*runner));
    progress.advance_to(runners.size());
  }
  const auto rounds = take_turns({&runners[0], &runners[1], &runners[2]}, command.pairs);
  if (!rounds) return tl::unexpected(rounds.error());
  progress.advance_to(4);
  const auto& [alone_ms, twin_ms, crowded_ms] = *rounds;
  device = runners[0].device();
  std::vector<Row> rows{row_of("airfield", runners[0], alone_ms),
                        row_of("airfield and crowd", runners[2], crowded_ms)};
  rows[1].pairs = paired_ratio(alone_ms, twin_ms, crowded_ms);
  return rows;
}

Json row_json(const Row& row) {
  Json json = Json::object();
  json.set("scene", row.scene)
      .set("width", row.scenario.sensor.width_px)
      .set("height", row.scenario.sensor.height_px);
  json.set("triangles", row.stats.triangles).set("instances", row.stats.instances);
  json.set("samples", row.stats.samples).set("samples_full", row.stats.samples_full);
  json.set("sample_mib", static_cast<double>(row.stats.sample_bytes) / (1 << 20));
  json.set("coarse_meshes", row.stats.coarse_meshes).set("setup_s", row.setup_s);
  json.set("warm_up_s", row.warm_up_s).set("frames", row.frame_ms.count());
  json.set("frame_ms_median", row.frame_ms.median()).set("frame_ms_max", row.frame_ms.max());
  json.set("ratio", row.pairs ? Json(row.pairs->ratio) : Json(nullptr));
  json.set("self_ratio", row.pairs ? Json(row.pairs->self_ratio) : Json(nullptr));
  json.set("self_ratio_spread", row.pairs ? Json(row.pairs->self_spread) : Json(nullptr));
  json.set("limit_ratio", row.pairs ? Json(kLimitRatio) : Json(nullptr));
  json.set("limit_met", row.pairs ? Json(row.pairs->within(kLimitRatio)) : Json(nullptr));
  json.set("rate_hz", SceneRunner::kRateHz);
  return json;
}

int run(const CrowdOptions& command) {
  const InterruptGuard interrupt;
  std::string device;
  const auto rows = run(command, device);
  if (!rows) return fail(rows.error());
  TextTable table({"scene", "triangles", "instances", "samples", "MiB", "setup s", "warm-up s",
                   "median ms", "max ms", "ratio", "limit", "met"});
  Json results = Json::array();
  for (const Row& row : *rows) {
    const std::string ratio = row.pairs ? fmt::format("{:.2f}", row.pairs->ratio) : "-";
    const char* met = !row.pairs ? "-" : row.pairs->within(kLimitRatio) ? "yes" : "NO";
    table.add({row.scene, fmt::format("{}", row.stats.triangles),
               fmt::format("{}", row.stats.instances), fmt::format("{}", row.stats.samples),
               fmt::format("{:.0f}", static_cast<double>(row.stats.sample_bytes) / (1 << 20)),
               fmt::format("{:.1f}", row.setup_s), fmt::format("{:.1f}", row.warm_up_s),
               fmt::format("{:.2f}", row.frame_ms.median()),
               fmt::format("{:.2f}", row.frame_ms.max()), ratio,
               row.pairs ? fmt::format("{:.1f}", kLimitRatio) : "-", met});
    results.push(row_json(row));
  }
  fmt::print(text_stream(command.json), "{}, commit {}\n{}", device, kCommit, table.to_string());
  if (command.json) {
    Json json = Json::object();
    json.set("device", device).set("commit", kCommit).set("suite", "crowd");
    json.set("results", std::move(results));
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  return kExitOk;
}

void add_options(CommandLine& line, CrowdOptions& options) {
  add_set(line, options.set);
  line.option("--instances", options.instances, "Figures").in_range(1U, 1'000'000U).show_default();
  line.option("--triangles", options.triangles, "Of each figure, at least")
      .in_range(1000U, 1'000'000U)
      .show_default();
  line.option("--pairs", options.pairs, "Frames of the two scenes that are shown in turn")
      .in_range(15U, 100'000U)
      .show_default();
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_bench_crowd(CommandLine& bench) {
  bench.command<CrowdOptions>({.name = "crowd",
                               .text = "The airfield with and without ten thousand figures of a "
                                       "thousand triangles: frame time, "
                                       "thermal samples and their memory",
                               .example = "emit bench crowd --json crowd.json"},
                              add_options, run);
}

}  // namespace emit::tool
