// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <span>
#include <utility>

#include "emit/physics/error.hpp"

namespace emit::protocol {

/// A result that is written under a temporary name beside its place and takes the place when it is
/// complete. Whatever fails before leaves an older file as it was.
/// Thread: one owner.  Real time: not RT-safe.
class PartFile {
 public:
  /// Chooses the names. A link is followed, so that its target is replaced. It creates nothing.
  /// Errors: invalid_argument (`target` is one of the inputs); io (`target` is there, but no
  /// regular file).
  [[nodiscard]] static physics::Result<PartFile> begin(
      const std::filesystem::path& target, std::span<const std::filesystem::path> inputs);
  PartFile(PartFile&& other) noexcept;
  PartFile& operator=(PartFile&&) = delete;
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;
  /// Removes the temporary file, unless commit() has moved it.
  ~PartFile();

  /// Returns the temporary name, which the caller creates, writes and closes.
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return part_; }
  /// Hands the file to the disk and moves it to its place. Errors (io) name the place.
  [[nodiscard]] physics::Result<void> commit();

 private:
  PartFile(std::filesystem::path target, std::filesystem::path part)
      : target_(std::move(target)), part_(std::move(part)) {}
  std::filesystem::path target_;
  std::filesystem::path part_;  // empty: nothing to remove
};

}  // namespace emit::protocol
