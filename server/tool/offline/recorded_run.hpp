// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

/// A recorded run as a part of its scenario, so that commands that know no host explain its frames.
namespace emit::tool {

/// Frame of a recorded run.
struct RecordedFrame {
  std::uint64_t frame_number = 0;
  std::int64_t sim_time_ns = 0;
  /// Doubts about the history of the frame, one sentence each.
  std::vector<std::string> notes;
};

/// Gives a scenario what the journal of its newest run says up to a rendered frame: the sensor
/// stands where it stood, with its field of view; entities go where the host moved them (from its
/// first pose on; before it they go as the scenario says, without motion in between); parts and
/// weather are the host's from its first word on. Between poses entities move linearly. Of an
/// entity the newest 4096 poses at least are kept, and evenly thinned ones of the time before. A
/// clear sky that a host replaces is a table of one row in 60 s until then.
/// @param log           journal, an MCAP file
/// @param frame_number  frame of that run; absent: the newest one
/// Errors: those of protocol::LogReader; config (the journal is of another scenario),
/// invalid_argument (the run has no such frame with an image), unsupported (the journal lacks the
/// begin of the run).
[[nodiscard]] physics::Result<RecordedFrame> follow_recording(
    const std::filesystem::path& log, std::optional<std::uint64_t> frame_number,
    scene::ScenarioDesc& scenario);

}  // namespace emit::tool
