// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "app/replay.hpp"
#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

struct JournalReplayOptions {
  std::filesystem::path log;
  double speed = 0.0;  ///< multiple of the recorded pace; 0: as fast as it goes
  int gpu_index = -1;
  bool temperature = false;  ///< the views carry temperature, depth and object too
};

struct JournalReplaySummary {
  std::uint64_t frames = 0;
  std::uint64_t rendered = 0;  ///< other frames were repeats
  std::uint64_t mismatches = 0;
  std::uint64_t first_mismatch = 0;  ///< frame number; meaningful when mismatches > 0
  std::string device;
  std::string journal_device;
  double setup_s = 0.0;
  double play_s = 0.0;
};

/// Re-renders a journal on the calling thread and hands every frame to `on_frame`, which may stop
/// the replay with an error. A merged log may hold several daemons, one behind the other: each
/// begins with a surface that is warmed up anew. Warns on standard error when the journal was made
/// with another scenario or device, or lacks runs that the surface remembers. Errors: those of the
/// log reader, the renderer and the player.
[[nodiscard]] physics::Result<JournalReplaySummary> replay_journal(
    const scene::ScenarioDesc& scenario, const JournalReplayOptions& options,
    const std::function<physics::Result<void>(const server::ReplayedFrame&)>& on_frame);

}  // namespace emit::tool
