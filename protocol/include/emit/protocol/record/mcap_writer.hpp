// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <system_error>

#include "emit/physics/error.hpp"

namespace emit::protocol {

/// Options of an MCAP file.
struct McapWriterOptions {
  std::string profile{};  ///< empty: none
  std::string library = "emitd";
  std::uint32_t chunk_bytes = 256u << 10;  ///< 0 = messages without chunks, each written at once
  std::int64_t flush_interval_ns = 100'000'000;  ///< largest span of log time within a chunk
};

/// Writes MCAP files (public specification): uncompressed chunks with CRC-32, message and chunk
/// index, statistics, summary offsets, footer with CRC-32.
///
/// Every chunk goes to the file in one write, so a killed process leaves whole chunks and a file
/// that scanning readers accept. Errors (io) name file and offset and are final: after the first
/// one every call returns it again.
/// Thread: one owner.  Real time: not RT-safe.
class McapWriter {
 public:
  /// Creates or overwrites the file. Errors (io): the file cannot be written, or no folder takes
  /// the index that waits for close(); an existing file is then unchanged. A file that this call
  /// made is removed again when it fails.
  /// @param cause  becomes the system's reason for the failure, such as ENOSPC; empty where there
  ///   is none; null: not wanted
  [[nodiscard]] static physics::Result<McapWriter> create(const std::filesystem::path& path,
                                                          const McapWriterOptions& options,
                                                          std::error_code* cause = nullptr);
  McapWriter(McapWriter&&) noexcept;
  McapWriter& operator=(McapWriter&&) noexcept;
  ~McapWriter();  ///< closes the file as close() does; errors are lost

  /// Adds a schema and returns its id, from 1. Errors: io; invalid_argument (closed writer).
  [[nodiscard]] physics::Result<std::uint16_t> add_schema(std::string_view name,
                                                          std::string_view encoding,
                                                          std::string_view data);
  /// Adds a channel and returns its id, from 1. Errors: io; invalid_argument (unknown schema,
  /// closed writer).
  [[nodiscard]] physics::Result<std::uint16_t> add_channel(std::uint16_t schema_id,
                                                           std::string_view topic,
                                                           std::string_view message_encoding);
  /// Writes a message. Errors: io; invalid_argument (unknown channel, closed writer, negative
  /// time).
  [[nodiscard]] physics::Result<void> write(std::uint16_t channel_id, std::uint32_t sequence,
                                            std::int64_t log_time_ns, std::int64_t publish_time_ns,
                                            std::span<const std::byte> data);
  /// Returns the system's reason for the failure of a write; empty without a failure.
  [[nodiscard]] std::error_code failure_cause() const noexcept;
  /// Returns the number of messages that the kernel has taken. The others wait in the open chunk or
  /// are lost by a failure.
  [[nodiscard]] std::uint64_t messages_in_file() const noexcept;
  /// Hands the open chunk to the kernel. Errors: io; invalid_argument (closed writer).
  [[nodiscard]] physics::Result<void> flush();
  /// Writes summary and footer and closes the file. A second call does nothing. Errors: io.
  [[nodiscard]] physics::Result<void> close();

 private:
  struct Impl;
  explicit McapWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::protocol
