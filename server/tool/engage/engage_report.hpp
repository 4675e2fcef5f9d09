// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "tool/engage/loop_record.hpp"
#include "tool/engage/tracker_study.hpp"
#include "tool/support/json.hpp"

namespace emit::tool {

/// Outcome of a flight against a target.
struct EngageOutcome {
  double miss_m = 0.0;
  double closest_s = 0.0;  ///< time of the closest approach since the launch
  glm::dvec3 miss_offset_m{0.0};
  bool on_ground = false;
};

/// Everything that the report of `emit engage` says.
struct EngageResults {
  std::string scenario;
  std::string device;
  std::string host;
  std::string seeker;
  std::string channel;
  std::string band;
  double rate_hz = 0.0;
  double focal_px = 1.0;
  bool real_time = false;
  std::optional<LoopRecord> flight;
  std::optional<EngageOutcome> outcome;
  std::optional<TrackerStudy> study;
  std::optional<std::filesystem::path> gnss;
};

/// Returns the figures with their units in the keys. "flight" depends on the scenario and the
/// options alone when the loop runs in lock-step; "times" depends on the machine too.
[[nodiscard]] Json engage_json(const EngageResults& results);
/// Writes a row for each frame, with units in the columns' names. Errors: io.
/// @pre there was a flight
[[nodiscard]] physics::Result<void> write_frames_csv(const std::filesystem::path& file,
                                                     const EngageResults& results);
/// Returns the table of key figures for the terminal.
[[nodiscard]] std::string engage_text(const EngageResults& results);
/// Writes one HTML file with plots and pictures in it. Errors: io.
/// @param folder  where the pictures of the film strip lie
[[nodiscard]] physics::Result<void> write_engage_html(const std::filesystem::path& file,
                                                      const std::filesystem::path& folder,
                                                      const EngageResults& results);

}  // namespace emit::tool
