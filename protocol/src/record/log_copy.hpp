// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "emit/protocol/record/mcap_reader.hpp"
#include "emit/protocol/record/mcap_writer.hpp"
#include "emit/protocol/record/part_file.hpp"

namespace emit::protocol {

/// Copies messages of logs into a new log, with the schemas and channels of their files, each once.
/// The new log appears at its place when it is complete.
/// Thread: one owner.  Real time: not RT-safe.
class LogCopier {
 public:
  /// Begins the log beside `target`. Errors: those of PartFile::begin() and McapWriter::create().
  [[nodiscard]] static physics::Result<LogCopier> create(
      const std::filesystem::path& target, std::span<const std::filesystem::path> inputs,
      const McapWriterOptions& options);

  /// Writes the message that next() of `from` moved to, or `data` in its place. Messages of emitd's
  /// topics are numbered anew from 1, others keep their number. Errors: io; invalid_argument (a
  /// log time beyond 292 years).
  /// @param source  number of the reader, from 0: ids of channels are those of one file
  [[nodiscard]] physics::Result<void> copy(
      std::size_t source, const McapReader& from,
      std::optional<std::span<const std::byte>> data = std::nullopt);
  /// Writes the index, closes the log and moves it to its place. Errors: io.
  [[nodiscard]] physics::Result<void> finish();
  [[nodiscard]] std::uint64_t messages() const noexcept { return messages_; }

 private:
  struct Target {
    std::uint16_t id = 0;
    bool renumbered = false;
  };
  struct KnownSchema {
    McapSchema schema;
    std::uint16_t id = 0;
  };
  struct KnownChannel {
    McapChannel channel;  // its schema_id is that of the new log
    std::uint16_t id = 0;
  };

  LogCopier(PartFile part, McapWriter mcap) : part_(std::move(part)), mcap_(std::move(mcap)) {}
  [[nodiscard]] physics::Result<Target> target_of(std::size_t source, const McapReader& from,
                                                  std::uint16_t channel_id);
  [[nodiscard]] physics::Result<std::uint16_t> add_schema(const McapSchema* schema);
  [[nodiscard]] physics::Result<Target> add_channel(const McapReader& from,
                                                    const McapChannel& channel);

  PartFile part_;
  McapWriter mcap_;
  std::vector<KnownSchema> schemas_;
  std::vector<KnownChannel> channels_;
  std::map<std::pair<std::size_t, std::uint16_t>, Target> targets_;
  std::map<std::uint16_t, std::uint32_t> sequences_;  // last number by id of the new log
  std::uint64_t messages_ = 0;
};

}  // namespace emit::protocol
