// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/pose_csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "emit/protocol/convert.hpp"
#include "emit/v1/host.pb.h"

namespace emit::protocol {
namespace {

using physics::Error;
using physics::ErrorCode;
using physics::Result;

enum Column : std::size_t { kTime, kEast, kNorth, kUp, kQw, kQx, kQy, kQz, kFrame, kColumns };
constexpr std::array<std::string_view, kColumns> kNames{
    "sim_time_s", "east_m", "north_m", "up_m", "qw", "qx", "qy", "qz", "frame_number"};
constexpr std::size_t kMandatory = kFrame;
/// Largest magnitude of a time, s, the same as on the wire.
constexpr double kMaxTimeS = kMaxSimTimeNs / 1e9;

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) - begin + 1);
}

void split(std::string_view line, std::vector<std::string_view>& fields) {
  fields.clear();
  while (true) {
    const std::size_t comma = line.find(',');
    fields.push_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return;
    line.remove_prefix(comma + 1);
  }
}

template <class Number>
bool read_number(std::string_view text, Number& value) {
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  return code == std::errc{} && end == text.data() + text.size();
}

}  // namespace

struct PoseCsvReader::Impl {
  std::filesystem::path path;
  std::ifstream file;
  std::string line;
  std::uint64_t line_number = 0;
  std::vector<std::string_view> fields;
  std::array<std::optional<std::size_t>, kColumns> place;  // position of each column in a row
  HostFrameData host;
  bool has_row = false;
  std::optional<Error> failure;

  tl::unexpected<Error> fail(std::string_view text) {
    failure = Error{ErrorCode::parse, fmt::format("{}:{}: {}", path.string(), line_number, text)};
    return tl::unexpected(*failure);
  }

  /// Reads the next line with content and splits it. Returns false at the end.
  bool next_line() {
    while (std::getline(file, line)) {
      ++line_number;
      const std::string_view content = trimmed(line);
      if (content.empty() || content.front() == '#') continue;
      split(content, fields);
      return true;
    }
    return false;
  }

  Result<void> read_header() {
    if (!next_line()) return fail("no header row");
    for (std::size_t i = 0; i < fields.size(); ++i) {
      const auto name = std::ranges::find(kNames, fields[i]);
      if (name == kNames.end()) continue;
      auto& column = place[static_cast<std::size_t>(name - kNames.begin())];
      if (column) return fail(fmt::format("column '{}' twice", fields[i]));
      column = i;
    }
    for (std::size_t i = 0; i < kMandatory; ++i) {
      if (!place[i]) return fail(fmt::format("column '{}' is missing", kNames[i]));
    }
    return {};
  }

  template <class Number>
  Result<Number> value(Column column) {
    const std::size_t index = *place[column];
    if (index >= fields.size() || fields[index].empty()) {
      return fail(fmt::format("column '{}': no value", kNames[column]));
    }
    Number number{};
    if (!read_number(fields[index], number)) {
      return fail(fmt::format("column '{}': '{}' is not a number", kNames[column], fields[index]));
    }
    return number;
  }

  Result<void> read_row() {
    std::array<double, kMandatory> values{};
    for (std::size_t i = 0; i < kMandatory; ++i) {
      const auto number = value<double>(static_cast<Column>(i));
      if (!number) return tl::unexpected(number.error());
      values[i] = *number;
    }
    if (!(std::abs(values[kTime]) <= kMaxTimeS)) return fail("column 'sim_time_s': out of range");
    const auto sim_time_ns = static_cast<std::int64_t>(std::llround(values[kTime] * 1e9));
    if (has_row && sim_time_ns < host.sim_time_ns) return fail("column 'sim_time_s': goes back");
    std::uint64_t frame_number = host.frame_number + 1;
    if (place[kFrame]) {
      const auto number = value<std::uint64_t>(kFrame);
      if (!number) return tl::unexpected(number.error());
      frame_number = *number;
    }
    // Apply the same rules as to a pose from the wire.
    const physics::Pose pose{{values[kEast], values[kNorth], values[kUp]},
                             {values[kQw], values[kQx], values[kQy], values[kQz]}};
    v1::Pose message;
    to_proto(pose, std::nullopt, message);
    if (from_proto(message, host.seeker, host.seeker_rates) != DecodeStatus::ok) {
      return fail("invalid pose: not finite, too far away, or not a unit quaternion");
    }
    host.sim_time_ns = sim_time_ns;
    host.frame_number = frame_number;
    has_row = true;
    return {};
  }
};

PoseCsvReader::PoseCsvReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PoseCsvReader::PoseCsvReader(PoseCsvReader&&) noexcept = default;
PoseCsvReader& PoseCsvReader::operator=(PoseCsvReader&&) noexcept = default;
PoseCsvReader::~PoseCsvReader() = default;

Result<PoseCsvReader> PoseCsvReader::open(const std::filesystem::path& path) {
  std::error_code code;
  if (!std::filesystem::exists(path, code)) {
    return physics::make_error(ErrorCode::not_found, path.string() + ": no such file");
  }
  auto impl = std::make_unique<Impl>();
  impl->path = path;
  impl->file.open(path);
  if (!impl->file || std::filesystem::is_directory(path, code)) {
    return physics::make_error(ErrorCode::io, path.string() + ": cannot open");
  }
  if (auto header = impl->read_header(); !header) return tl::unexpected(header.error());
  return PoseCsvReader(std::move(impl));
}

Result<bool> PoseCsvReader::next() {
  if (impl_->failure) return tl::unexpected(*impl_->failure);
  if (!impl_->next_line()) return false;
  if (auto row = impl_->read_row(); !row) return tl::unexpected(row.error());
  return true;
}

const HostFrameData& PoseCsvReader::host() const noexcept {
  return impl_->host;
}

}  // namespace emit::protocol
