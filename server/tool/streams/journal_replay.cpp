// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/journal_replay.hpp"

#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <optional>
#include <thread>

#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/pose_pcap.hpp"
#include "emit/v1/control.pb.h"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

void warn_of_differences(const server::JournalPlayer& player, const std::string& scenario_hash,
                         const std::string& device) {
  if (player.scenario_sha256() != scenario_hash) {
    warn(
        "the journal was recorded with another scenario, or its files have changed since: frames "
        "may differ; give the --scenario and every --set value that the daemon had");
  }
  if (player.device() != device) {
    warn(fmt::format("the journal was recorded on '{}', this is '{}': frames may differ",
                     player.device(), device));
  }
}

/// Facts about a journal that a replay needs before it plays it.
struct JournalOutline {
  std::uint64_t frames = 0;
  std::int64_t first_time_ns = 0;  ///< simulation time that the daemon was warmed up for
  std::uint64_t first_sequence = 0;
};
/// Returns the outline of a journal, up to what does not read. The replay itself reports errors of
/// the log.
JournalOutline outline_of(const std::filesystem::path& file) {
  JournalOutline outline;
  bool started = false;
  auto log = protocol::LogReader::open(file);
  while (log && !InterruptGuard::interrupted()) {
    const auto more = log->next();
    if (!more || !*more) break;
    if (log->topic() != protocol::LogTopic::journal) continue;
    const v1::JournalEntry& entry = log->journal();
    if (entry.has_frame()) ++outline.frames;
    if (outline.first_sequence == 0) outline.first_sequence = entry.sequence();
    if (entry.has_run_start() && !started) {
      started = true;
      outline.first_time_ns = entry.run_start().first_time_ns();
    }
  }
  return outline;
}

/// A source in the state in which a daemon starts, and the player that feeds it.
struct ReplayedDaemon {
  std::unique_ptr<server::FrameSource> source;
  std::optional<server::JournalPlayer> player;

  /// Warms a new source up, in place of the former one.
  physics::Result<void> start(const scene::ScenarioDesc& scenario,
                              const JournalReplayOptions& options, std::int64_t first_time_ns) {
    player.reset();
    source.reset();
    renderer::OutputOptions output;
    output.temperature = output.depth = output.object = options.temperature;
    output.slots = 3;
    output.ladder = renderer::Ladder::replayed;
    Progress warm_up("warm-up", 1000);
    auto made = server::make_renderer_source(
        scenario, renderer::DeviceOptions{options.gpu_index, false}, output, first_time_ns,
        [&](double done_frac) {
          warm_up.advance_to(static_cast<std::uint64_t>(1000.0 * done_frac));
          return !InterruptGuard::interrupted();
        });
    if (!made) return tl::unexpected(made.error());
    auto channels = server::make_channels(scenario, (*made)->info());
    if (!channels) return tl::unexpected(channels.error());
    source = std::move(*made);
    player.emplace(*source, std::move(*channels));
    return {};
  }
};

}  // namespace

physics::Result<JournalReplaySummary> replay_journal(
    const scene::ScenarioDesc& scenario, const JournalReplayOptions& options,
    const std::function<physics::Result<void>(const server::ReplayedFrame&)>& on_frame) {
  if (protocol::PosePcapReader::is_capture(options.log)) {
    return physics::make_error(
        physics::ErrorCode::unsupported,
        fmt::format(
            "{}: a network capture holds the host's poses, not the daemon's decisions: play "
            "it with emit send and record the journal",
            options.log.string()));
  }
  auto log = protocol::LogReader::open(options.log);
  if (!log) return tl::unexpected(log.error());
  const auto scenario_hash = server::scenario_sha256(scenario);
  if (!scenario_hash) return tl::unexpected(scenario_hash.error());

  const JournalOutline outline = outline_of(options.log);
  JournalReplaySummary summary;
  auto start = Clock::now();
  ReplayedDaemon daemon;
  if (auto started = daemon.start(scenario, options, outline.first_time_ns); !started) {
    return tl::unexpected(started.error());
  }
  const renderer::SceneStats& scene = daemon.source->info().scene;
  for (const std::string& text : scene.warnings) warn(text);
  for (const std::string& text : renderer::warm_up_warnings(scene)) warn(text);
  if (outline.first_sequence > 1 && scenario.thermal.method == scene::ThermalMethod::cached) {
    warn(
        "the journal lacks earlier runs of its daemon, and a cached surface remembers them: frames "
        "may differ");
  }
  summary.device = daemon.source->info().device;
  summary.setup_s = seconds_since(start);

  Progress progress("replay", outline.frames);
  start = Clock::now();
  std::int64_t first_wall_ns = 0;
  bool compared_run = false;
  std::uint64_t last_sequence = 0;
  while (!InterruptGuard::interrupted()) {
    const auto more = log->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    if (log->topic() != protocol::LogTopic::journal) continue;
    const v1::JournalEntry& entry = log->journal();
    if (options.speed > 0.0 && entry.has_frame()) {
      if (first_wall_ns == 0) first_wall_ns = entry.wall_time_ns();
      const double offset_s =
          1e-9 * static_cast<double>(entry.wall_time_ns() - first_wall_ns) / options.speed;
      std::this_thread::sleep_until(start + std::chrono::duration_cast<Clock::duration>(
                                                std::chrono::duration<double>(offset_s)));
    }
    // Another daemon begins where the numbers do, as in a merged log. Its surface was warmed up
    // anew.
    if (entry.has_run_start() && entry.sequence() <= last_sequence) {
      auto restarted = daemon.start(scenario, options, entry.run_start().first_time_ns());
      if (!restarted) return tl::unexpected(restarted.error());
      compared_run = false;
    }
    last_sequence = entry.sequence();
    server::JournalPlayer& player = *daemon.player;
    const auto applied = player.apply(entry);
    if (!applied) return tl::unexpected(applied.error());
    if (entry.has_run_start() && !compared_run) {
      compared_run = true;
      summary.journal_device = player.device();
      warn_of_differences(player, *scenario_hash, summary.device);
    }
    if (!*applied) continue;
    const server::ReplayedFrame& frame = **applied;
    if (frame.view != nullptr && frame.view->device_failed) {
      return physics::make_error(
          physics::ErrorCode::gpu,
          fmt::format("frame {}: the device reported an error", frame.frame_number));
    }
    ++summary.frames;
    if (!frame.matches) ++summary.mismatches;
    if (!frame.repeated) ++summary.rendered;
    if (!frame.matches && summary.first_mismatch == 0) summary.first_mismatch = frame.frame_number;
    if (on_frame) {
      if (auto handled = on_frame(frame); !handled) return tl::unexpected(handled.error());
    }
    progress.advance_to(summary.frames);
  }
  progress.finish();
  if (log->truncation()) warn(*log->truncation());
  summary.play_s = seconds_since(start);
  if (summary.frames == 0) {
    return physics::make_error(
        physics::ErrorCode::parse,
        fmt::format("{}: the log holds no journalled frame", options.log.string()));
  }
  return summary;
}

}  // namespace emit::tool
