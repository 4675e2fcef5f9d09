// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/recording.hpp"
#include "app/replay.hpp"
#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"
#include "tool/streams/replay_pace.hpp"

namespace emit::tool {

struct JournalReplayOptions {
  std::filesystem::path log;
  double speed = 0.0;                     ///< multiple of the recorded pace; 0: as fast as it goes
  std::optional<std::int64_t> from_ns{};  ///< first simulation time shown, ns; absent: the begin
  std::optional<std::int64_t> to_ns{};    ///< last simulation time shown, ns; absent: the end
  std::optional<std::uint64_t> run_id{};  ///< run of the range; absent: the only one within it
  std::uint64_t passes = 1;               ///< times that the range is played; 0: until interrupted
  bool anyway = false;                    ///< a decisive difference from the recording is a warning
  int gpu_index = -1;
  bool temperature = false;  ///< the views carry temperature, depth and object too

  /// True when one run, or a part of it, is shown rather than the whole log.
  [[nodiscard]] bool is_part() const noexcept { return from_ns || to_ns || run_id; }
};

/// The means of a replay. Tests put their own in.
struct ReplayBench {
  /// Makes a source that is warmed up for a frame at this simulation time, ns.
  std::function<physics::Result<std::unique_ptr<server::FrameSource>>(std::int64_t first_time_ns)>
      make_source;
  std::optional<scene::ScenarioDesc> scenario;  ///< of the channels; absent: canned frames
  server::SourceInfo expected;                  ///< source, as far as it is known before it is made
  ReplayClock* clock = nullptr;
};

/// Wish of the caller about the next frame of the range.
enum class ReplayOrder : std::uint8_t {
  show,  ///< render it and hand it over
  pass,  ///< render it for the state of the scene, like those before the range
  anew,  ///< begin the range again, with a surface that is warmed up anew
  end,   ///< end the replay in order
};

/// Calls to the caller of a replay. Each may be empty.
struct ReplayHooks {
  /// Is called once, when it is known which runs of the log are played, by their place in it.
  std::function<physics::Result<void>(std::size_t first_run, std::size_t last_run)> on_plan;
  /// Takes a new player; the one before it is gone.
  std::function<void(server::JournalPlayer&)> on_start;
  /// Takes a frame of the range, with the number of the pass from 1; an error ends the replay.
  std::function<physics::Result<void>(const server::ReplayedFrame&, std::uint64_t pass)> on_frame;
  /// Is asked before each frame of the range, with its number from 0.
  std::function<ReplayOrder(std::uint64_t frame)> order;
  /// Is asked behind the last frame of the range, with the number of frames: `anew` or `end`. Where
  /// it is empty, JournalReplayOptions::passes decides.
  std::function<ReplayOrder(std::uint64_t frames)> at_end;
};

struct JournalReplaySummary {
  std::uint64_t frames = 0;    ///< shown, over all passes
  std::uint64_t rendered = 0;  ///< other frames were repeats
  std::uint64_t mismatches = 0;
  std::uint64_t first_mismatch = 0;  ///< frame number; meaningful when mismatches > 0
  std::uint64_t frames_before = 0;   ///< played for the state of the scene, but not shown
  std::uint64_t mismatches_before = 0;
  std::uint64_t passes = 0;    ///< begun
  std::int64_t latest_ns = 0;  ///< longest time that a frame came after it was due
  std::string device;
  server::RunOrigin recorded;  ///< of the first run that was played
  /// Differences from the recording, each once.
  std::vector<server::SetupDifference> differences;
  double setup_s = 0.0;
  double play_s = 0.0;
};

/// Returns the bench of a scenario on the device. The clock is the caller's.
[[nodiscard]] ReplayBench renderer_bench(const scene::ScenarioDesc& scenario,
                                         const JournalReplayOptions& options, ReplayClock& clock);

/// Re-renders a journal on the calling thread and hands its frames to `hooks`.
///
/// A part of a log is a range of one run. Everything since the start of the daemon that recorded it
/// is rendered first, without being shown, so that the frames of the range have the pixels of a
/// whole replay. A merged log may hold several daemons, one behind the other: each begins with a
/// surface that is warmed up anew, and so does each pass. The pace begins anew there. Frames before
/// the range are not paced.
///
/// Warns on standard error of every difference from the recording, by name.
/// Errors: those of the log reader, the renderer and the player; config (the scenario or the
/// channels are not those of the recording, unless options.anyway); invalid_argument (no or several
/// runs have frames in the range); parse (the log holds no frame).
[[nodiscard]] physics::Result<JournalReplaySummary> replay_journal(
    const ReplayBench& bench, const JournalReplayOptions& options, const ReplayHooks& hooks);

}  // namespace emit::tool
