// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/pose_csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/csv.hpp"
#include "emit/physics/limits.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/v1/host.pb.h"

namespace emit::protocol {
namespace {

using physics::CsvCell;
using physics::CsvReader;
using physics::Error;
using physics::ErrorCode;
using physics::Result;

enum Column : std::size_t {
  kTime,
  kEast,
  kNorth,
  kUp,
  kQw,
  kQx,
  kQy,
  kQz,
  kFrame,
  kFov,
  kGimbalYaw,
  kGimbalPitch,
  kGimbalRoll,
  kVelocityEast,
  kVelocityNorth,
  kVelocityUp,
  kRateX,
  kRateY,
  kRateZ,
  kColumns
};
constexpr std::array<std::string_view, kColumns> kNames{"sim_time_s",
                                                        "east_m",
                                                        "north_m",
                                                        "up_m",
                                                        "qw",
                                                        "qx",
                                                        "qy",
                                                        "qz",
                                                        "frame_number",
                                                        "fov_h_rad",
                                                        "gimbal_yaw_rad",
                                                        "gimbal_pitch_rad",
                                                        "gimbal_roll_rad",
                                                        "velocity_east_m_s",
                                                        "velocity_north_m_s",
                                                        "velocity_up_m_s",
                                                        "rate_x_rad_s",
                                                        "rate_y_rad_s",
                                                        "rate_z_rad_s"};
constexpr std::size_t kMandatory = kFrame;
constexpr std::array kGimbal{kGimbalYaw, kGimbalPitch, kGimbalRoll};
constexpr std::array kRates{kVelocityEast, kVelocityNorth, kVelocityUp, kRateX, kRateY, kRateZ};

/// Column of a drive of a part.
struct PartColumn {
  std::size_t place = 0;  ///< position in a row
  PartCommandData command;
};

/// Reads a number of a column's name and moves `text` behind it.
std::optional<std::uint32_t> leading_number(std::string_view& text) {
  std::uint32_t value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc{}) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return value;
}

/// Returns what a column drives whose name is "entity_7.part_1.temperature_k", or power_w_m2 or
/// throttle in its place; nothing for other names.
std::optional<PartCommandData> part_of_column(std::string_view name) {
  using Kind = PartCommandData::Kind;
  constexpr std::string_view kEntity = "entity_";
  constexpr std::string_view kPart = ".part_";
  PartCommandData out;
  if (!name.starts_with(kEntity)) return std::nullopt;
  name.remove_prefix(kEntity.size());
  const auto entity_id = leading_number(name);
  if (!entity_id || !name.starts_with(kPart)) return std::nullopt;
  name.remove_prefix(kPart.size());
  const auto part_id = leading_number(name);
  if (!part_id) return std::nullopt;
  out.entity_id = *entity_id;
  out.part_id = *part_id;
  if (name == ".temperature_k") {
    out.kind = Kind::temperature;
  } else if (name == ".power_w_m2") {
    out.kind = Kind::power;
  } else if (name == ".throttle") {
    out.kind = Kind::throttle;
  } else {
    return std::nullopt;
  }
  return out;
}

}  // namespace

struct PoseCsvReader::Impl {
  CsvReader csv;
  std::array<std::optional<std::size_t>, kColumns> place;  ///< position of each column in a row
  std::vector<PartColumn> part_columns;
  HostFrameData host;
  bool has_row = false;
  std::optional<Error> failure;

  explicit Impl(CsvReader reader) : csv(std::move(reader)) {}

  Result<void> find_columns() {
    for (std::size_t i = 0; i < kColumns; ++i) {
      auto found = csv.find(kNames[i]);
      if (found) {
        place[i] = *found;
      } else if (i < kMandatory || has_column(kNames[i])) {
        return tl::unexpected(std::move(found.error()));
      }
    }
    if (auto whole = check_group(kGimbal); !whole) return whole;
    if (auto whole = check_group(kRates); !whole) return whole;
    for (std::size_t i = 0; i < csv.header().size(); ++i) {
      const auto part = part_of_column(csv.header()[i].text);
      if (!part) continue;
      for (const PartColumn& other : part_columns) {
        if (other.command.entity_id != part->entity_id || other.command.part_id != part->part_id) {
          continue;
        }
        return fail(csv.header()[i], fmt::format("column '{}': another column drives this part",
                                                 csv.header()[i].text));
      }
      part_columns.push_back({i, *part});
    }
    return {};
  }
  /// Refuses a part of a group. Two of three angles would leave it open whether the third one is 0
  /// or stays as it is.
  [[nodiscard]] Result<void> check_group(std::span<const Column> group) const {
    const auto there = std::ranges::find_if(group, [this](Column c) { return bool(place[c]); });
    if (there == group.end()) return {};
    for (const Column column : group) {
      if (place[column]) continue;
      return fail(csv.header()[*place[*there]],
                  fmt::format("column '{}' is missing: it belongs to '{}'", kNames[column],
                              kNames[*there]));
    }
    return {};
  }
  [[nodiscard]] bool has_column(std::string_view name) const {
    for (const CsvCell& cell : csv.header()) {
      if (cell.text == name) return true;
    }
    return false;
  }

  [[nodiscard]] const CsvCell& cell(Column column) const { return csv.row()[*place[column]]; }
  tl::unexpected<Error> fail(const CsvCell& at, std::string_view text) const {
    return physics::make_error(ErrorCode::parse, fmt::format("{}: {}", csv.place_of(at), text));
  }

  [[nodiscard]] Result<double> number(Column column) const {
    const CsvCell& at = cell(column);
    if (at.text.empty()) return fail(at, fmt::format("column '{}': no value", kNames[column]));
    const std::optional<double> value = physics::csv_number(at.text);
    if (value) return *value;
    return fail(
        at, fmt::format("column '{}': {}", kNames[column], physics::not_a_number_text(at.text)));
  }

  tl::unexpected<Error> out_of_range(Column column, const DecodeFault& fault) const {
    return fail(cell(column),
                fmt::format("column '{}': {} is out of range, must be {} to {}", kNames[column],
                            cell(column).text, fault.lowest, fault.highest));
  }
  [[nodiscard]] bool is_empty(Column column) const {
    return !place[column] || cell(column).text.empty();
  }
  [[nodiscard]] bool all_empty(std::span<const Column> group) const {
    return std::ranges::all_of(group, [this](Column column) { return is_empty(column); });
  }

  /// Reads field of view and gimbal. Empty cells leave them as they are.
  Result<void> read_view() {
    host.fov_h_rad.reset();
    host.gimbal_rad.reset();
    DecodeFault fault;
    if (!is_empty(kFov)) {
      const auto fov_h_rad = number(kFov);
      if (!fov_h_rad) return tl::unexpected(fov_h_rad.error());
      if (check_fov_h(*fov_h_rad, &fault) != DecodeStatus::ok) return out_of_range(kFov, fault);
      host.fov_h_rad = *fov_h_rad;
    }
    if (all_empty(kGimbal)) return {};
    glm::dvec3 gimbal_rad{0.0};
    for (std::size_t i = 0; i < kGimbal.size(); ++i) {
      const auto angle_rad = number(kGimbal[i]);
      if (!angle_rad) return tl::unexpected(angle_rad.error());
      // The angles before this one are in range, so that a fault is that of this one.
      gimbal_rad[static_cast<glm::length_t>(i)] = *angle_rad;
      if (check_gimbal(gimbal_rad, &fault) != DecodeStatus::ok) {
        return out_of_range(kGimbal[i], fault);
      }
    }
    host.gimbal_rad = gimbal_rad;
    return {};
  }

  /// Reads the rates of the seeker. Empty cells mean that the host does not know them.
  Result<std::optional<PoseRates>> read_rates() {
    if (all_empty(kRates)) return std::optional<PoseRates>();
    PoseRates rates;
    for (std::size_t i = 0; i < kRates.size(); ++i) {
      const auto value = number(kRates[i]);
      if (!value) return tl::unexpected(value.error());
      const auto axis = static_cast<glm::length_t>(i % 3);
      (i < 3 ? rates.velocity_world_m_s : rates.angular_rate_body_rad_s)[axis] = *value;
      DecodeFault fault;
      if (check_pose({}, rates, &fault) != DecodeStatus::ok) return out_of_range(kRates[i], fault);
    }
    return rates;
  }

  [[nodiscard]] Result<std::uint64_t> frame_number() const {
    if (!place[kFrame]) return host.frame_number + 1;
    const CsvCell& at = cell(kFrame);
    std::string_view digits = at.text;
    if (digits.starts_with('+')) digits.remove_prefix(1);
    std::uint64_t value = 0;
    const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (code == std::errc{} && end == digits.data() + digits.size()) return value;
    return fail(at, at.text.empty()
                        ? std::string("column 'frame_number': no value")
                        : fmt::format("column 'frame_number': '{}' is not a whole number from 0 on",
                                      at.text));
  }

  /// Reads the commands to parts: a number, "off", or nothing where the part goes on as it is.
  Result<void> read_parts() {
    host.part_count = 0;
    for (const PartColumn& column : part_columns) {
      const CsvCell& at = csv.row()[column.place];
      if (at.text.empty()) continue;
      PartCommandData command = column.command;
      if (at.text == "off") {
        command.kind = PartCommandData::Kind::off;
      } else if (const auto value = physics::csv_number(at.text)) {
        command.value = *value;
      } else {
        return fail(at, fmt::format("column '{}': {}", csv.header()[column.place].text,
                                    physics::not_a_number_text(at.text)));
      }
      DecodeFault fault;
      if (check_part(command, &fault) != DecodeStatus::ok) {
        return fail(at, fmt::format("column '{}': {} is {}, must be {} to {}",
                                    csv.header()[column.place].text, fault.field, fault.value,
                                    fault.lowest, fault.highest));
      }
      if (host.part_count == kMaxPartsPerFrame) {
        return fail(at, fmt::format("more than {} commands to parts in a row", kMaxPartsPerFrame));
      }
      host.parts[host.part_count++] = command;
    }
    return {};
  }

  Result<void> read_row() {
    std::array<double, kMandatory> values{};
    for (std::size_t i = 0; i < kMandatory; ++i) {
      const auto value = number(static_cast<Column>(i));
      if (!value) return tl::unexpected(value.error());
      values[i] = *value;
    }
    constexpr double kMaxTimeS = physics::limits::kMaxSimTimeS;
    if (!(std::abs(values[kTime]) <= kMaxTimeS)) {
      return fail(cell(kTime),
                  fmt::format("column 'sim_time_s': {} is out of range, must be {} .. {}{}",
                              cell(kTime).text, -kMaxTimeS, kMaxTimeS,
                              physics::unix_time_hint(values[kTime])));
    }
    const auto sim_time_ns = static_cast<std::int64_t>(std::llround(values[kTime] * 1e9));
    if (has_row && sim_time_ns < host.sim_time_ns) {
      return fail(cell(kTime),
                  fmt::format("column 'sim_time_s': goes back from {} to {}",
                              static_cast<double>(host.sim_time_ns) * 1e-9, values[kTime]));
    }
    const auto frame = frame_number();
    if (!frame) return tl::unexpected(frame.error());
    // Apply the same rules as to a pose from the wire.
    const physics::Pose pose{{values[kEast], values[kNorth], values[kUp]},
                             {values[kQw], values[kQx], values[kQy], values[kQz]}};
    const auto rates = read_rates();
    if (!rates) return tl::unexpected(rates.error());
    v1::Pose message;
    to_proto(pose, *rates, message);
    if (from_proto(message, host.seeker, host.seeker_rates) != DecodeStatus::ok) {
      return fail(
          csv.row()[0],
          fmt::format("invalid pose: position {}, {}, {} m (at most {} m each), quaternion "
                      "{}, {}, {}, {} (norm {} .. {})",
                      values[kEast], values[kNorth], values[kUp], kMaxPositionM, values[kQw],
                      values[kQx], values[kQy], values[kQz], physics::limits::kQuaternionNorm.lo,
                      physics::limits::kQuaternionNorm.hi));
    }
    if (auto view = read_view(); !view) return view;
    if (auto parts = read_parts(); !parts) return parts;
    host.sim_time_ns = sim_time_ns;
    host.frame_number = *frame;
    has_row = true;
    return {};
  }
};

PoseCsvReader::PoseCsvReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PoseCsvReader::PoseCsvReader(PoseCsvReader&&) noexcept = default;
PoseCsvReader& PoseCsvReader::operator=(PoseCsvReader&&) noexcept = default;
PoseCsvReader::~PoseCsvReader() = default;

Result<PoseCsvReader> PoseCsvReader::open(const std::filesystem::path& path) {
  auto csv = CsvReader::open(path);
  if (!csv) return tl::unexpected(std::move(csv.error()));
  auto impl = std::make_unique<Impl>(std::move(*csv));
  if (auto found = impl->find_columns(); !found) return tl::unexpected(std::move(found.error()));
  return PoseCsvReader(std::move(impl));
}

Result<bool> PoseCsvReader::next() {
  if (impl_->failure) return tl::unexpected(*impl_->failure);
  auto more = impl_->csv.next();
  if (more && *more) {
    if (auto row = impl_->read_row(); !row) more = tl::unexpected(std::move(row.error()));
  }
  if (!more) impl_->failure = more.error();
  return more;
}

const HostFrameData& PoseCsvReader::host() const noexcept {
  return impl_->host;
}

}  // namespace emit::protocol
