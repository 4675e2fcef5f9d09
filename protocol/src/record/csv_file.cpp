// SPDX-License-Identifier: Apache-2.0
#include "record/csv_file.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <iterator>
#include <system_error>

namespace emit::protocol {

using physics::Result;

CsvFile::CsvFile(std::filesystem::path target, PartFile part)
    : target_(std::move(target)), part_(std::move(part)) {
  errno = 0;
  out_.open(part_.path(), std::ios::binary | std::ios::trunc);
  if (!out_) error_ = errno != 0 ? errno : EIO;
}

Result<CsvFile> CsvFile::create(const std::filesystem::path& target,
                                std::span<const std::filesystem::path> inputs,
                                std::string_view header) {
  auto part = PartFile::begin(target, inputs);
  if (!part) return tl::unexpected(part.error());
  CsvFile file(target, std::move(*part));
  if (file.error_ != 0) return file.cannot_write();
  file.out_ << header << '\n';
  return file;
}

tl::unexpected<physics::Error> CsvFile::cannot_write() const {
  return physics::make_error(physics::ErrorCode::io,
                             fmt::format("{}: cannot write: {}", target_.string(),
                                         std::generic_category().message(error_)));
}

void CsvFile::next_cell() {
  if (row_begun_) row_ += ',';
  row_begun_ = true;
}

CsvFile& CsvFile::text(std::string_view value) {
  next_cell();
  if (value.find_first_of(",\"\r\n") == std::string_view::npos) {
    row_ += value;
    return *this;
  }
  row_ += '"';
  for (const char c : value) {
    if (c == '"') row_ += '"';
    row_ += c;
  }
  row_ += '"';
  return *this;
}

CsvFile& CsvFile::whole(std::uint64_t value) {
  next_cell();
  fmt::format_to(std::back_inserter(row_), "{}", value);
  return *this;
}

CsvFile& CsvFile::whole(std::int64_t value) {
  next_cell();
  fmt::format_to(std::back_inserter(row_), "{}", value);
  return *this;
}

CsvFile& CsvFile::number(double value) {
  next_cell();
  fmt::format_to(std::back_inserter(row_), "{:.17g}", value);
  return *this;
}

CsvFile& CsvFile::seconds(std::int64_t time_ns) {
  next_cell();
  constexpr std::uint64_t kNsPerS = 1'000'000'000;
  const auto bits = static_cast<std::uint64_t>(time_ns);
  const std::uint64_t size_ns = time_ns < 0 ? 0 - bits : bits;
  fmt::format_to(std::back_inserter(row_), "{}{}.{:09}", time_ns < 0 ? "-" : "", size_ns / kNsPerS,
                 size_ns % kNsPerS);
  return *this;
}

CsvFile& CsvFile::empty(std::size_t cells) {
  for (std::size_t i = 0; i < cells; ++i) next_cell();
  return *this;
}

void CsvFile::end_row() {
  row_ += '\n';
  if (error_ == 0) {
    errno = 0;
    out_ << row_;
    if (!out_) error_ = errno != 0 ? errno : EIO;
  }
  row_.clear();
  row_begun_ = false;
  ++rows_;
}

Result<void> CsvFile::finish() {
  if (error_ == 0) {
    errno = 0;
    out_.close();
    if (!out_) error_ = errno != 0 ? errno : EIO;
  }
  if (error_ != 0) return cannot_write();
  return part_.commit();
}

}  // namespace emit::protocol
