// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <system_error>

#include "emit/physics/error.hpp"
#include "emit/protocol/codec.hpp"
#include "emit/protocol/host_frame.hpp"

namespace emit::v1 {
class HostFrame;
class JournalEntry;
class RecordedFrame;
}  // namespace emit::v1

/// Logs of emitd (docs/wire.md section 6): MCAP files with the topics `host` (emit.v1.HostFrame)
/// and `journal` (emit.v1.JournalEntry), and on request `frames` (emit.v1.RecordedFrame). They
/// describe themselves, so any MCAP tool reads them.
namespace emit::protocol {

inline constexpr const char* kHostTopic = "host";
inline constexpr const char* kJournalTopic = "journal";
inline constexpr const char* kFrameTopic = "frames";  ///< read by FrameLogReader

/// Topic of a message in a log.
enum class LogTopic : std::uint8_t { host, journal };

/// Options of a log file.
struct LogWriterOptions {
  /// Limits of a chunk, bytes and ns. A chunk goes to the file when it holds chunk_bytes, or when a
  /// message's log time is flush_interval_ns after that of the chunk's first one. A killed process
  /// loses no more than that. chunk_bytes = 0: every message goes to the file at once, without
  /// chunks.
  std::uint32_t chunk_bytes = 256u << 10;
  std::int64_t flush_interval_ns = 100'000'000;
  std::string software{};  ///< name of the writing software, for the file's header
  bool frames = false;     ///< the log gets the topic `frames` too
};

/// Writes a log.
/// Thread: one owner.  Real time: not RT-safe, it writes to the file.
class LogWriter {
 public:
  /// Creates or truncates `path`. Errors (io) name the path. A file that this call made is removed
  /// again when it fails; so is one whose first message does not reach the disk.
  /// @param cause  becomes the system's reason for the failure, such as ENOSPC; empty where there
  ///   is none; null: not wanted
  [[nodiscard]] static physics::Result<LogWriter> create(const std::filesystem::path& path,
                                                         const LogWriterOptions& options = {},
                                                         std::error_code* cause = nullptr);
  LogWriter(LogWriter&&) noexcept;
  LogWriter& operator=(LogWriter&&) noexcept;
  /// Closes the file as close() does; errors are lost.
  ~LogWriter();

  /// Writes a host frame. Errors: io; invalid_argument (negative log time, closed log).
  /// @param log_time_ns  wall instant of receipt, ns TAI; in a log that was made rather than
  ///   recorded, the simulation time; not negative
  [[nodiscard]] physics::Result<void> write_host(const HostFrameData& frame,
                                                 std::int64_t log_time_ns);
  [[nodiscard]] physics::Result<void> write_host(const v1::HostFrame& frame,
                                                 std::int64_t log_time_ns);
  /// Writes a journal entry; its log time is wall_time_ns. Errors as for write_host().
  [[nodiscard]] physics::Result<void> write_journal(const v1::JournalEntry& entry);
  /// Writes a journal entry that is already encoded, as a recorder receives it. Errors as for
  /// write_host().
  [[nodiscard]] physics::Result<void> write_journal(std::span<const std::byte> encoded_entry,
                                                    std::int64_t log_time_ns);
  /// Writes the image of a frame. Errors as for write_host(); also invalid_argument where
  /// LogWriterOptions::frames is not set.
  [[nodiscard]] physics::Result<void> write_frame(const v1::RecordedFrame& frame,
                                                  std::int64_t log_time_ns);
  /// Returns the number of messages that the kernel has taken. The others wait for flush() or are
  /// lost by a failure.
  [[nodiscard]] std::uint64_t messages_in_file() const noexcept;
  /// Hands all messages written so far to the kernel. Errors: io.
  [[nodiscard]] physics::Result<void> flush();
  /// Writes index and footer and closes the file. Further writes are errors; a second close does
  /// nothing. Errors: io.
  [[nodiscard]] physics::Result<void> close();

 private:
  struct Impl;
  explicit LogWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Reads the messages of the two topics in file order. Other topics are skipped.
/// Thread: one owner.  Real time: not RT-safe.
class LogReader {
 public:
  /// Opens a log. Errors: not_found; io; parse (no MCAP file) names offset and reason.
  [[nodiscard]] static physics::Result<LogReader> open(const std::filesystem::path& path);
  LogReader(LogReader&&) noexcept;
  LogReader& operator=(LogReader&&) noexcept;
  ~LogReader();

  /// Moves to the next message. Returns false at the end. A tail cut off by a crash is an end, see
  /// truncation(). Errors (parse, unsupported) name file and offset: a wrong CRC or length, a
  /// compressed chunk, a message that is no HostFrame or JournalEntry, or an invalid host frame.
  [[nodiscard]] physics::Result<bool> next();

  // The functions below describe the message that next() moved to.
  [[nodiscard]] LogTopic topic() const noexcept;
  [[nodiscard]] std::int64_t log_time_ns() const noexcept;
  /// Returns the host frame.
  /// @pre topic() is host
  [[nodiscard]] const HostFrameData& host() const noexcept;
  /// Returns the journal entry.
  /// @pre topic() is journal
  [[nodiscard]] const v1::JournalEntry& journal() const noexcept;

  /// Returns a description of the missing tail, with its offset, at the end of a file that was cut
  /// off.
  [[nodiscard]] const std::optional<std::string>& truncation() const noexcept;

 private:
  struct Impl;
  explicit LogReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::protocol
