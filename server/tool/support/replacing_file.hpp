// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string_view>
#include <utility>

#include "emit/physics/error.hpp"
#include "emit/protocol/record/part_file.hpp"

namespace emit::tool {

/// A file that takes the place of another one only when it is complete. It is written beside its
/// target under a name of its own. A target that is no plain file, such as a pipe, is written
/// itself, and "-" is standard output. Thread: one owner. Real time: not RT-safe.
class ReplacingFile {
 public:
  /// Errors (io) name the path.
  [[nodiscard]] static physics::Result<ReplacingFile> create(const std::filesystem::path& target);
  ReplacingFile(ReplacingFile&& other) noexcept;
  ReplacingFile& operator=(ReplacingFile&&) = delete;
  /// Removes what was written, unless commit() succeeded.
  ~ReplacingFile();

  /// Errors: io.
  [[nodiscard]] physics::Result<void> write(std::string_view bytes);
  /// Closes the file and gives it the name of the target. Errors: io; the target is as before.
  [[nodiscard]] physics::Result<void> commit();

 private:
  explicit ReplacingFile(std::filesystem::path target) : target_(std::move(target)) {}
  [[nodiscard]] tl::unexpected<physics::Error> failure(int error_number) const;

  std::filesystem::path target_;
  std::optional<protocol::PartFile> part_;  ///< absent: the target itself is written
  std::FILE* file_ = nullptr;
};

}  // namespace emit::tool
