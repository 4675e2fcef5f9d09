// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "emit/physics/error.hpp"

namespace emit::protocol {

struct McapSchema {
  std::string name;
  std::string encoding;
  std::string data;
};
struct McapChannel {
  std::uint16_t schema_id = 0;  ///< 0 = none
  std::string topic;
  std::string message_encoding;
};
struct McapMessage {
  std::uint16_t channel_id = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time_ns = 0;
  std::uint64_t publish_time_ns = 0;
  std::span<const std::byte> data;  ///< valid until the next call of next()
  std::uint64_t file_offset = 0;    ///< of the message or of the chunk around it
};

/// Reads MCAP files front to back, without need of summary or index: every uncompressed file, also
/// one whose writer was killed.
///
/// Checks every length before use and every chunk's CRC before its messages are handed out. Errors
/// name file and offset. Reads one chunk at a time.
/// Thread: one owner.  Not RT-safe.
class McapReader {
 public:
  /// Errors: not_found, io, parse (no MCAP file).
  [[nodiscard]] static physics::Result<McapReader> open(const std::filesystem::path& path);
  McapReader(McapReader&&) noexcept;
  McapReader& operator=(McapReader&&) noexcept;
  ~McapReader();

  /// Moves to the next message; false at the end. Errors: io, parse, unsupported (compression);
  /// an error is final.
  [[nodiscard]] physics::Result<bool> next();
  [[nodiscard]] const McapMessage& message() const noexcept;

  /// Of an id that a message carried; nullptr when unknown.
  [[nodiscard]] const McapChannel* channel(std::uint16_t id) const noexcept;
  [[nodiscard]] const McapSchema* schema(std::uint16_t id) const noexcept;

  /// Set at the end of a file that has no footer or ends within a record: where and what.
  [[nodiscard]] const std::optional<std::string>& truncation() const noexcept;

 private:
  struct Impl;
  explicit McapReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::protocol
