// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <filesystem>
#include <span>

namespace emit::fuzz {

/// Regular file in memory, for readers that take a path. There is one per process, and no file
/// exists beside it. The process ends where the system refuses.
class MemoryFile {
 public:
  MemoryFile();
  ~MemoryFile();
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  void put(std::span<const std::byte> bytes);
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  int fd_;
  std::filesystem::path path_;
};

/// Returns the path of the file after writing these bytes to it.
[[nodiscard]] const std::filesystem::path& file_of(std::span<const std::byte> bytes);

}  // namespace emit::fuzz
