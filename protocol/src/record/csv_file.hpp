// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <fstream>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "emit/physics/error.hpp"
#include "emit/protocol/record/part_file.hpp"

namespace emit::protocol {

/// Writes a CSV file (RFC 4180, but with line feeds) under a temporary name.
///
///   file->text("box").number(0.5).end_row();
///
/// Thread: one owner.  Real time: not RT-safe.
class CsvFile {
 public:
  /// Errors: those of PartFile::begin(); io.
  [[nodiscard]] static physics::Result<CsvFile> create(
      const std::filesystem::path& target, std::span<const std::filesystem::path> inputs,
      std::string_view header);

  CsvFile& text(std::string_view value);
  CsvFile& whole(std::uint64_t value);
  CsvFile& whole(std::int64_t value);
  CsvFile& flag(bool value) { return whole(std::uint64_t{value ? 1U : 0U}); }
  /// Writes a number with 17 significant digits, so that it reads back as the same one.
  CsvFile& number(double value);
  /// Writes a time in seconds, exact to the nanosecond.
  CsvFile& seconds(std::int64_t time_ns);
  CsvFile& empty(std::size_t cells = 1);
  /// Ends the row. Errors are found by finish().
  void end_row();

  [[nodiscard]] std::uint64_t rows() const noexcept { return rows_; }
  /// Errors: io (the file could not be written).
  [[nodiscard]] physics::Result<void> finish();

 private:
  CsvFile(std::filesystem::path target, PartFile part);
  void next_cell();
  [[nodiscard]] tl::unexpected<physics::Error> cannot_write() const;

  std::filesystem::path target_;
  PartFile part_;
  std::ofstream out_;
  std::string row_;
  bool row_begun_ = false;
  std::uint64_t rows_ = 0;
  int error_ = 0;  // errno of the first failure
};

}  // namespace emit::protocol
