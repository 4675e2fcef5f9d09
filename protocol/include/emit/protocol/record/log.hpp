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
}  // namespace emit::v1

/// emitd's own logs: MCAP files with the topics `host` (emit.v1.HostFrame) and `journal`
/// (emit.v1.JournalEntry). They describe themselves; any MCAP tool reads them.
namespace emit::protocol {

inline constexpr const char* kHostTopic = "host";
inline constexpr const char* kJournalTopic = "journal";

enum class LogTopic : std::uint8_t { host, journal };

struct LogWriterOptions {
  /// A chunk goes to the file when it holds this much, and when a message's log time is
  /// flush_interval_ns after the first one's in it: a killed process loses no more. 0 = every
  /// message goes to the file at once, without chunks.
  std::uint32_t chunk_bytes = 256u << 10;
  std::int64_t flush_interval_ns = 100'000'000;
  std::string software{};  ///< written to the file's header as the library that made it
};

/// Thread: one owner.  Not RT-safe: writes to the file.
class LogWriter {
 public:
  /// Creates or truncates `path`. Errors (io) name it. A file that this call made is removed again
  /// when it fails; so is one whose first message does not reach the disk.
  /// @param cause  becomes the system's reason for the failure, such as ENOSPC; empty where there
  ///               is none; null: not wanted
  [[nodiscard]] static physics::Result<LogWriter> create(const std::filesystem::path& path,
                                                         const LogWriterOptions& options = {},
                                                         std::error_code* cause = nullptr);
  LogWriter(LogWriter&&) noexcept;
  LogWriter& operator=(LogWriter&&) noexcept;
  /// Closes as close() does, without telling of errors.
  ~LogWriter();

  /// log_time_ns: wall, TAI; in a log that was made rather than recorded, the sim time. >= 0.
  [[nodiscard]] physics::Result<void> write_host(const HostFrameData& frame,
                                                 std::int64_t log_time_ns);
  [[nodiscard]] physics::Result<void> write_host(const v1::HostFrame& frame,
                                                 std::int64_t log_time_ns);
  /// Log time is the entry's wall_time_ns.
  [[nodiscard]] physics::Result<void> write_journal(const v1::JournalEntry& entry);
  /// As above for an entry already encoded, as a recorder gets it.
  [[nodiscard]] physics::Result<void> write_journal(std::span<const std::byte> encoded_entry,
                                                    std::int64_t log_time_ns);
  /// Returns the number of messages that the kernel has taken. The others wait for flush() or are
  /// lost by a failure.
  [[nodiscard]] std::uint64_t messages_in_file() const noexcept;
  /// Hands everything to the kernel.
  [[nodiscard]] physics::Result<void> flush();
  /// Writes index and footer. Further writes are errors; a second close does nothing.
  [[nodiscard]] physics::Result<void> close();

 private:
  struct Impl;
  explicit LogWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Reads messages of the two topics in file order; other topics are skipped.
/// Thread: one owner.
class LogReader {
 public:
  /// Errors: not_found, io, parse (not an MCAP file; offset and reason).
  [[nodiscard]] static physics::Result<LogReader> open(const std::filesystem::path& path);
  LogReader(LogReader&&) noexcept;
  LogReader& operator=(LogReader&&) noexcept;
  ~LogReader();

  /// Moves to the next message; false at the end. A tail cut off by a crash is an end, see
  /// truncation(). Errors (parse, unsupported) name file and offset: bad CRC, bad length, a
  /// compressed chunk, a message that is no HostFrame or JournalEntry, or an invalid host frame.
  [[nodiscard]] physics::Result<bool> next();

  // Of the message that next() moved to:
  [[nodiscard]] LogTopic topic() const noexcept;
  [[nodiscard]] std::int64_t log_time_ns() const noexcept;
  /// Precondition: topic() is host.
  [[nodiscard]] const HostFrameData& host() const noexcept;
  /// Precondition: topic() is journal.
  [[nodiscard]] const v1::JournalEntry& journal() const noexcept;

  /// Set at the end of a file whose tail is missing: says where and what.
  [[nodiscard]] const std::optional<std::string>& truncation() const noexcept;

 private:
  struct Impl;
  explicit LogReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::protocol
