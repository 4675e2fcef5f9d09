// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <system_error>
#include <vector>

namespace emit::renderer {

/// Returns the CRC-64/XZ (ECMA-182, reflected) of bytes, or continues that of the bytes before
/// them. It detects accidental changes, not forgery.
[[nodiscard]] std::uint64_t crc64_xz(std::span<const std::byte> bytes,
                                     std::uint64_t before = 0) noexcept;

/// Sink of put_value() that writes a file anew, block by block, and takes the checksum on the way.
/// After a failure it writes nothing more; finish() returns the failure.
class FileSink {
 public:
  explicit FileSink(const std::filesystem::path& file);
  ~FileSink();
  FileSink(const FileSink&) = delete;
  FileSink& operator=(const FileSink&) = delete;

  void put(const void* data, std::size_t bytes);
  /// Returns the checksum of everything that was put so far.
  [[nodiscard]] std::uint64_t checksum();
  /// Writes the rest to the disk and closes the file. The error code is empty on success.
  [[nodiscard]] std::error_code finish();

 private:
  static constexpr std::size_t kBlockBytes = std::size_t{1} << 20U;
  void write_block();

  int fd_;
  int error_;  ///< errno of the first failure; 0: none
  std::uint64_t checksum_ = 0;
  std::vector<std::byte> block_;
};

}  // namespace emit::renderer
