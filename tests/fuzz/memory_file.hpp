// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <filesystem>
#include <span>

namespace emit::fuzz {

/// A regular file that lies in memory only, for readers that take a path. One per process; its
/// siblings do not exist. Ends the process where the system refuses.
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

/// The file with these bytes.
[[nodiscard]] const std::filesystem::path& file_of(std::span<const std::byte> bytes);

}  // namespace emit::fuzz
