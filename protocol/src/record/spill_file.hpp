// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <system_error>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::protocol {

/// Buffer for bytes that are written at the end of a file. The newest kBlockBytes are in memory,
/// the older ones in a nameless file, which the kernel removes however the process ends.
///
/// Errors (io) name the file.
/// Thread: one owner.  Real time: not RT-safe.
class SpillFile {
 public:
  static constexpr std::size_t kBlockBytes = std::size_t{256} << 10;

  /// Creates the nameless file, so that a folder that takes none is reported at the start. The
  /// folder is that of the file `beside`, links followed, which need not exist yet; otherwise the
  /// one for temporary files.
  [[nodiscard]] physics::Result<void> open(const std::filesystem::path& beside);
  /// Returns the system's reason why the last folder took no file; empty where open() succeeded.
  [[nodiscard]] std::error_code cause() const noexcept { return cause_; }
  SpillFile() = default;
  SpillFile(const SpillFile&) = delete;
  SpillFile& operator=(const SpillFile&) = delete;
  ~SpillFile();

  /// Appends bytes.
  [[nodiscard]] physics::Result<void> append(std::span<const std::byte> bytes);
  /// Returns the number of bytes appended.
  [[nodiscard]] std::uint64_t size() const noexcept { return spilled_bytes_ + block_.size(); }

  /// Copies up to `into.size()` bytes from `offset` and returns their number. It is smaller only at
  /// the end.
  [[nodiscard]] physics::Result<std::size_t> read(std::uint64_t offset,
                                                  std::span<std::byte> into) const;

 private:
  [[nodiscard]] physics::Result<void> spill();
  [[nodiscard]] physics::Result<void> failed(const char* action, int error) const;

  std::string name_;  // description for messages
  std::vector<std::byte> block_;
  std::uint64_t spilled_bytes_ = 0;
  int fd_ = -1;
  std::error_code cause_;
};

}  // namespace emit::protocol
