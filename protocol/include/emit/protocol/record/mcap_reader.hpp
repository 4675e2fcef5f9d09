// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "emit/physics/error.hpp"

namespace emit::protocol {

/// Schema record of an MCAP file.
struct McapSchema {
  std::string name;
  std::string encoding;
  std::string data;
};
/// Channel record of an MCAP file.
struct McapChannel {
  std::uint16_t schema_id = 0;  ///< 0 = none
  std::string topic;
  std::string message_encoding;
};
/// Facts that an MCAP file states beside its messages.
struct McapFacts {
  std::string profile;            ///< empty: none
  std::string library;            ///< name of the writing software
  std::uint64_t file_bytes = 0;   ///< size of the file when it was opened
  std::uint64_t chunks = 0;       ///< chunks read so far
  std::uint64_t attachments = 0;  ///< attachments passed so far
  std::uint64_t metadata = 0;     ///< metadata records passed so far
};
/// Message of an MCAP file.
struct McapMessage {
  std::uint16_t channel_id = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time_ns = 0;
  std::uint64_t publish_time_ns = 0;
  std::span<const std::byte> data;  ///< valid until the next call of next()
  std::uint64_t file_offset = 0;    ///< offset of the message or of the chunk that holds it
};

/// Reads MCAP files from front to back, without summary or index. It reads every uncompressed file,
/// also one whose writer was killed.
///
/// It checks every length before use, and every chunk's CRC before it hands out its messages.
/// Errors name file and offset. One chunk at a time is in memory.
/// Thread: one owner.  Real time: not RT-safe.
class McapReader {
 public:
  /// Opens a file. Errors: not_found, io, parse (no MCAP file).
  [[nodiscard]] static physics::Result<McapReader> open(const std::filesystem::path& path);
  McapReader(McapReader&&) noexcept;
  McapReader& operator=(McapReader&&) noexcept;
  ~McapReader();

  /// Moves to the next message. Returns false at the end. Errors: io, parse, unsupported
  /// (compression). An error is final.
  [[nodiscard]] physics::Result<bool> next();
  /// Returns the message that next() moved to.
  [[nodiscard]] const McapMessage& message() const noexcept;

  /// Returns the channel or schema of an id that a message carried; nullptr when the id is unknown.
  [[nodiscard]] const McapChannel* channel(std::uint16_t id) const noexcept;
  [[nodiscard]] const McapSchema* schema(std::uint16_t id) const noexcept;

  /// Returns all channels and schemas that were read so far, by id.
  [[nodiscard]] const std::map<std::uint16_t, McapChannel>& channels() const noexcept;
  [[nodiscard]] const std::map<std::uint16_t, McapSchema>& schemas() const noexcept;
  /// Returns what the file says of itself, as far as it was read. The header is read by the first
  /// call of next().
  [[nodiscard]] const McapFacts& facts() const noexcept;
  [[nodiscard]] const std::filesystem::path& path() const noexcept;

  /// Returns a description of what is missing, with its offset, at the end of a file that has no
  /// footer or ends within a record.
  [[nodiscard]] const std::optional<std::string>& truncation() const noexcept;

 private:
  struct Impl;
  explicit McapReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::protocol
