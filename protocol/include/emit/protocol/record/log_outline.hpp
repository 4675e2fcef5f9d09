// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/protocol/record/mcap_reader.hpp"

namespace emit::v1 {
class Recording;
}

namespace emit::protocol {

/// Called while a log is read, with the bytes of input that are done. Returns false to stop.
using LogProgress = std::function<bool(std::uint64_t done_bytes)>;

/// Smallest and largest of some instants, ns. What they count from is said where one is used.
struct LogSpan {
  std::int64_t first_ns = 0;
  std::int64_t last_ns = 0;

  /// Makes the span hold an instant. An empty span becomes one of that instant alone.
  static void extend(std::optional<LogSpan>& span, std::int64_t at_ns) noexcept;
};

/// Messages of one topic and type.
struct LogTopicOutline {
  std::string topic;
  std::string message;   ///< name of the message type; empty: no schema
  std::string encoding;  ///< encoding of the messages
  std::uint64_t messages = 0;
  std::optional<LogSpan> log_time;  ///< ns as in the file: wall TAI in what emitd records
  std::optional<LogSpan> sim_time;  ///< simulation time, ns; only of emitd's own topics
};

/// One run of a journal.
struct LogRunOutline {
  /// False: the file begins in the middle of this run, so that its run id is not known.
  bool has_start = false;
  /// True: the daemon began anew here, because the sequence numbers do not go on.
  bool begins_process = false;
  std::uint64_t run_id = 0;
  std::string scenario_name;
  std::string scenario_sha256;
  std::string software;
  std::string device;
  std::string pacing;
  std::int64_t first_time_ns = 0;  ///< simulation time that the surface was warmed up for
  /// Setup of the daemon; runs with the same one share it. Null: the journal does not say it.
  std::shared_ptr<const v1::Recording> recording;
  std::uint64_t first_sequence = 0;
  std::uint64_t last_sequence = 0;
  std::uint64_t host_frames = 0;
  std::uint64_t commands = 0;
  std::uint64_t frames = 0;
  std::uint64_t rendered = 0;  ///< the other frames were repeats
  std::uint64_t first_frame = 0;
  std::uint64_t last_frame = 0;
  std::optional<LogSpan> log_time;  ///< wall time, ns TAI
  std::optional<LogSpan> sim_time;  ///< simulation time of the frames, ns
};

/// Consecutive host frames of one run id, in the topic `host`.
struct LogHostRunOutline {
  std::uint64_t run_id = 0;
  std::uint64_t frames = 0;
  std::uint64_t first_frame = 0;
  std::uint64_t last_frame = 0;
  std::optional<LogSpan> sim_time;  ///< ns
};

/// Entries that a journal lacks.
struct LogGap {
  std::uint64_t first_missing = 0;  ///< sequence number
  std::uint64_t last_missing = 0;
};

/// Contents of a log.
struct LogOutline {
  static constexpr std::size_t kMaxGaps = 100;

  McapFacts facts;
  std::vector<LogTopicOutline> topics;
  std::vector<McapSchema> schemas;
  std::vector<LogRunOutline> runs;           ///< of the journal
  std::vector<LogHostRunOutline> host_runs;  ///< of the topic `host`
  std::uint64_t journal_entries = 0;
  std::uint64_t frames = 0;
  std::uint64_t rendered = 0;
  std::array<std::uint64_t, 32> frames_with_flag{};  ///< by bit of FrameFlags
  std::vector<LogGap> gaps;                          ///< the first kMaxGaps ones
  std::uint64_t gap_count = 0;
  std::uint64_t missing_entries = 0;
  /// Tail that a crash cut off, see McapReader::truncation().
  std::optional<std::string> truncation;
  /// Error that ended the reading, with file and offset. The rest covers what stands before it.
  std::optional<physics::Error> damage;
};

/// Reads a log from front to back and describes it. Errors: those of McapReader::open(); internal
/// (`progress` asked to stop). What does not read is no error but `damage`. Memory: one chunk, and
/// some words per run.
/// Thread: any.  Real time: not RT-safe.
[[nodiscard]] physics::Result<LogOutline> outline_log(const std::filesystem::path& path,
                                                      const LogProgress& progress = {});

}  // namespace emit::protocol
