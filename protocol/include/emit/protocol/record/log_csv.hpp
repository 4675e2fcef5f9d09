// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "emit/physics/error.hpp"
#include "emit/protocol/record/log_outline.hpp"

namespace emit::protocol {

/// Table that a log is exported to. Each has a header row with units in the names, and numbers with
/// 17 significant digits; simulation times are exact to the nanosecond.
enum class LogTable : std::uint8_t {
  seeker,          ///< poses and view of the seeker that the host sent, as CSV pose logs have them
  entities,        ///< states of entities that the host sent
  frames,          ///< frames of a journal with flags and the pose of the sensor that they used
  frame_entities,  ///< states of entities as frames used them
  weather,         ///< weather that the host sent
  parts,           ///< commands to parts of entities that the host sent
  events,          ///< run starts, commands, missing entries, the cut of a crash
};
inline constexpr std::size_t kLogTables = 7;
/// Names of the tables, in the order of LogTable; a folder holds NAME.csv of each.
inline constexpr std::array<std::string_view, kLogTables> kLogTableNames{
    "seeker", "entities", "frames", "frame_entities", "weather", "parts", "events"};

/// Options of export_log_csv().
struct LogCsvOptions {
  /// Table to write; absent: all of them, into a folder.
  std::optional<LogTable> table{};
  std::uint16_t host_port = 0;  ///< of captures: UDP port that the host sent to
  LogProgress progress{};
};

/// Result of export_log_csv().
struct LogCsvSummary {
  std::array<std::uint64_t, kLogTables> rows{};  ///< without the header rows
  std::optional<std::string> notes;  ///< about a tail cut off, or packets that were skipped
};

/// Writes the poses, frames, weather and events of a log or a network capture as CSV (RFC 4180).
/// A folder is created with its parents. Files are written under temporary names and moved to their
/// places at the end. Memory: one chunk.
/// Errors: those of McapReader and PosePcapReader, with file and offset; io; invalid_argument (an
/// output is the input); unsupported (no message of emitd).
/// Thread: any.  Real time: not RT-safe.
[[nodiscard]] physics::Result<LogCsvSummary> export_log_csv(const std::filesystem::path& in,
                                                            const std::filesystem::path& out,
                                                            const LogCsvOptions& options);

}  // namespace emit::protocol
