// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <optional>

#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/streams/journal_replay.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

struct ReplayOptions {
  std::filesystem::path log;
  ScenarioChoice input;
  std::optional<std::filesystem::path> out;
  std::string png_of = "apparent";
  std::string speed = "max";
  int gpu_index = -1;
  std::optional<std::filesystem::path> json;
};

int run(const ReplayOptions& command) {
  const auto speed = parse_speed(command.speed);
  if (!speed) return fail(kExitUsage, "--speed: a positive number or max");
  const auto scenario = load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  if (command.out) {
    if (auto made = make_directory(*command.out); !made) return fail(made.error());
  }

  constexpr std::size_t plane = 0;  // bands are in the order of the channels
  const scene::SpectralBand band =
      plane < scenario->bands.size() ? scenario->bands[plane] : scene::SpectralBand{};
  const PngStyle style{scenario->display.min_k, scenario->display.max_k,
                       png_quantity(command.png_of)};
  JournalReplayOptions options;
  options.log = command.log;
  options.speed = *speed;
  options.gpu_index = command.gpu_index;
  options.temperature = command.out.has_value();
  std::optional<ApparentTemperature> apparent;
  if (command.out && physics::validate(spectral_band(band))) apparent.emplace(spectral_band(band));
  const InterruptGuard interrupt;
  const auto summary = replay_journal(
      *scenario, options, [&](const server::ReplayedFrame& frame) -> physics::Result<void> {
        if (!frame.matches) {
          warn(fmt::format("frame {}: CRC {:08x}, recorded {:08x}", frame.frame_number,
                           frame.crc32c, frame.journal_crc32c));
        }
        if (!command.out || frame.view == nullptr) return {};
        FramePlanes planes;
        planes.width_px = frame.view->width_px;
        planes.height_px = frame.view->height_px;
        planes.radiance_w_m2_sr = frame.view->radiance_w_m2_sr[plane];
        planes.temperature_k = frame.view->temperature_k;
        planes.depth_m = frame.view->depth_m;
        planes.object_id = frame.view->object_id;
        planes.apparent = apparent ? &*apparent : nullptr;
        planes.metadata = {frame.sim_time_ns, frame.frame_number, frame.view->sensor_pose,
                           band.name,         band.lo_um,         band.hi_um,
                           "W m-2 sr-1",      response_of(band)};
        return write_frame_files(*command.out, planes, style);
      });
  if (!summary) return fail(summary.error());

  fmt::print(text_stream(command.json),
             "{} frames replayed ({} rendered) in {:.2f} s, {} differ from the recording: {}\n",
             summary->frames, summary->rendered, summary->play_s, summary->mismatches,
             summary->mismatches == 0 ? "bit-identical" : "NOT identical");
  if (command.json) {
    Json json = Json::object();
    json.set("device", summary->device).set("recorded_device", summary->journal_device);
    json.set("frames", summary->frames).set("rendered", summary->rendered);
    json.set("mismatches", summary->mismatches).set("seconds", summary->play_s);
    json.set("bit_identical", summary->mismatches == 0);
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  if (summary->mismatches > 0) {
    return fail(kExitFailure,
                fmt::format("{} of {} frames differ, the first is frame {}", summary->mismatches,
                            summary->frames, summary->first_mismatch));
  }
  return kExitOk;
}

void add_options(CommandLine& line, ReplayOptions& options) {
  line.path("log", options.log, "MCAP log of emit record, or of the daemon's journal").required();
  add_scenario(line, options.input, "--scenario");
  line.output_folder("--out", options.out, "Folder for frame_NNNNNN.exr and .png");
  add_png_of(line, options.png_of, true);
  line.option("--speed", options.speed, "Multiple of the recorded pace, or max")
      .type_name("X")
      .show_default();
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_replay(CommandLine& tool) {
  tool.command<ReplayOptions>(
      {.name = "replay",
       .text =
           "Apply a recorded journal and check every frame bit for bit; exits 1 on a difference",
       .example = "emit replay run.mcap --scenario airfield --out frames"},
      add_options, run);
}

}  // namespace emit::tool
