// SPDX-License-Identifier: Apache-2.0
#include "tool/foxglove/recorded_place.hpp"

#include <array>
#include <charconv>
#include <chrono>
#include <string_view>

#include "emit/physics/units.hpp"
#include "emit/v1/control.pb.h"

namespace emit::tool {
namespace {

/// Returns the whole number that a text is, or nothing.
std::optional<int> whole(std::string_view text) {
  int out = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return out;
}

std::optional<double> number(std::string_view text) {
  double out = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return out;
}

/// Reads an instant as a journal spells it, YYYY-MM-DDThh:mm:ss with up to nine decimals and Z.
std::optional<std::int64_t> posix_ns(std::string_view text) {
  using namespace std::chrono;
  constexpr std::size_t kWithoutDecimals = 20;
  constexpr std::size_t kMaxDecimals = 9;
  if (text.size() < kWithoutDecimals || text.back() != 'Z') return std::nullopt;
  constexpr std::array<std::pair<std::size_t, std::size_t>, 6> kFields{
      {{0, 4}, {5, 2}, {8, 2}, {11, 2}, {14, 2}, {17, 2}}};
  std::array<int, kFields.size()> fields{};
  for (std::size_t i = 0; i < kFields.size(); ++i) {
    const auto value = whole(text.substr(kFields[i].first, kFields[i].second));
    if (!value) return std::nullopt;
    fields[i] = *value;
  }
  const year_month_day date{year{fields[0]}, month{static_cast<unsigned>(fields[1])},
                            day{static_cast<unsigned>(fields[2])}};
  if (!date.ok()) return std::nullopt;
  std::string_view decimals = text.substr(kWithoutDecimals - 1);
  decimals.remove_suffix(1);
  int fraction_ns = 0;
  if (!decimals.empty()) {
    if (decimals.front() != '.' || decimals.size() > kMaxDecimals + 1) return std::nullopt;
    decimals.remove_prefix(1);
    const auto value = whole(decimals);
    if (!value) return std::nullopt;
    fraction_ns = *value;
    for (std::size_t i = decimals.size(); i < kMaxDecimals; ++i) fraction_ns *= 10;
  }
  const sys_time<nanoseconds> instant = sys_days(date) + hours(fields[3]) + minutes(fields[4]) +
                                        seconds(fields[5]) + nanoseconds(fraction_ns);
  return instant.time_since_epoch().count();
}

}  // namespace

RecordedPlace recorded_place(const v1::Recording& recording) {
  RecordedPlace out;
  std::optional<double> lat_deg;
  std::optional<double> lon_deg;
  std::optional<double> height_m;
  for (const v1::ConfigValue& value : recording.scenario()) {
    if (value.key() == "epoch_utc") out.epoch_utc_ns = posix_ns(value.value());
    if (value.key() == "place.lat_deg") lat_deg = number(value.value());
    if (value.key() == "place.lon_deg") lon_deg = number(value.value());
    if (value.key() == "place.height_m") height_m = number(value.value());
  }
  if (lat_deg && lon_deg && height_m) {
    out.origin = physics::GeoPlace{physics::Radians(*lat_deg * physics::kDegree),
                                   physics::Radians(*lon_deg * physics::kDegree),
                                   physics::Metres(*height_m)};
  }
  return out;
}

}  // namespace emit::tool
