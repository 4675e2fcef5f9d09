// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>

#include "emit/physics/error.hpp"
#include "emit/protocol/host_frame.hpp"

namespace emit::protocol {

/// Reads seeker poses from a CSV file, one host frame per row (columns: docs/wire.md section 6).
/// The format is that of physics::CsvReader. Thread: one owner.  Real time: not RT-safe.
class PoseCsvReader {
 public:
  /// Opens a file and reads its header row. Errors: those of physics::CsvReader; parse, when a
  /// mandatory column is missing or stands twice.
  [[nodiscard]] static physics::Result<PoseCsvReader> open(const std::filesystem::path& path);
  PoseCsvReader(PoseCsvReader&&) noexcept;
  PoseCsvReader& operator=(PoseCsvReader&&) noexcept;
  ~PoseCsvReader();

  /// Moves to the next row. Returns false at the end. Errors (parse) name file, line and column:
  /// not a number, a missing value, an invalid pose, a time that is out of
  /// range or goes back. An error is final.
  [[nodiscard]] physics::Result<bool> next();
  /// Returns the host frame of the row that next() moved to.
  [[nodiscard]] const HostFrameData& host() const noexcept;

 private:
  struct Impl;
  explicit PoseCsvReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::protocol
