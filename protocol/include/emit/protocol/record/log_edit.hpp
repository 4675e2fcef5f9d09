// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/protocol/record/log_outline.hpp"

/// Cutting and merging of logs. Both read their inputs twice, hold one message of each in memory,
/// and write under a temporary name that becomes the result's at the end. An input is never written
/// over. Errors name the file at fault and, where bytes are wrong, their offset.
/// Thread: any.  Real time: not RT-safe.
namespace emit::protocol {

/// Options of cut_log().
struct LogCutOptions {
  std::optional<std::int64_t> from_ns{};  ///< first simulation time wanted, ns; absent: the begin
  std::optional<std::int64_t> to_ns{};    ///< last simulation time wanted, ns; absent: the end
  std::optional<std::uint64_t> run_id{};  ///< absent: the only run with a frame in the range
  /// Journals: leave out the runs before the wanted one. Frames of a scene with
  /// thermal.method = "cached" then differ, because its surface remembers earlier runs.
  bool only_run = false;
  std::string software{};  ///< name of the writing software, for the file's header
  LogProgress progress{};  ///< bytes of the input, read twice
};

/// Result of cut_log().
struct LogCutSummary {
  bool journal = false;  ///< false: a pose log, so that frames are host frames
  std::uint64_t run_id = 0;
  std::uint64_t messages = 0;
  std::uint64_t frames = 0;            ///< frames of the wanted run in the range
  std::uint64_t frames_before = 0;     ///< kept frames of the wanted run before the range
  std::uint64_t earlier_runs = 0;      ///< kept runs before the wanted one
  std::uint64_t left_out_runs = 0;     ///< runs of the same daemon that only_run left out
  std::uint64_t other_messages = 0;    ///< messages of other topics, left out
  std::uint64_t carried_entities = 0;  ///< pose logs: states put into the first frame
  std::uint64_t carried_parts = 0;     ///< pose logs: commands to parts put into the first frame
  bool carried_weather = false;
  bool carried_view = false;              ///< pose logs: field of view or gimbals
  std::optional<std::string> truncation;  ///< of the input
};

/// Cuts a range of simulation time out of a log.
///
/// A journal keeps every entry from the start of the daemon that recorded the run to the last frame
/// before the first one behind the range: the state of the scene comes from all of them, so that
/// fewer would replay to other pixels. A pose log keeps the host frames of the range. The first one
/// takes on the newest weather, field of view, gimbals and commands to parts, and the states of
/// entities that earlier frames of the run have set, as jumps without rates.
///
/// Errors: those of McapReader; invalid_argument (the range is empty, the output is an input, no or
/// more than one run has a frame in the range); unsupported (neither journal nor pose log, the run
/// has no start, entries are missing, the first frame cannot carry all entities or parts).
[[nodiscard]] physics::Result<LogCutSummary> cut_log(const std::filesystem::path& in,
                                                     const std::filesystem::path& out,
                                                     const LogCutOptions& options);

/// Options of merge_logs().
struct LogMergeOptions {
  std::string software{};  ///< name of the writing software, for the file's header
  LogProgress progress{};  ///< bytes of all inputs, read twice
};

/// Result of merge_logs().
struct LogMergeSummary {
  std::uint64_t messages = 0;
  std::uint64_t runs = 0;
  std::uint64_t frames = 0;
  std::vector<std::filesystem::path> order;  ///< inputs by the time of their first message
  std::vector<std::string> notes;            ///< about tails cut off and records left out
};

/// Joins logs by log time. The order within a file stays, and so do the bytes of every message.
/// Messages of the same instant come in the order of the files' first messages, then of the
/// arguments.
///
/// Errors: those of McapReader; invalid_argument (fewer than two inputs, a file given twice, the
/// output is an input); unsupported (journals of different scenarios, with the same run, that
/// overlap in time or do not follow each other; pose logs of one run that overlap).
[[nodiscard]] physics::Result<LogMergeSummary> merge_logs(
    std::span<const std::filesystem::path> inputs, const std::filesystem::path& out,
    const LogMergeOptions& options);

}  // namespace emit::protocol
