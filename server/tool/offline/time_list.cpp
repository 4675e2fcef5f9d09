// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/time_list.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <ctime>
#include <optional>
#include <utility>

#include "emit/physics/limits.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr double kDayS = 86'400.0;

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(' ');
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(' ') - first + 1);
}

std::optional<double> number(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

/// Seconds since midnight of HH:MM[:SS].
std::optional<double> seconds_of_day(std::string_view text) {
  std::array<double, 3> parts{};
  std::size_t count = 0;
  for (std::size_t begin = 0; begin <= text.size(); ++count) {
    if (count == parts.size()) return std::nullopt;
    const std::size_t end = std::min(text.find(':', begin), text.size());
    const auto value = number(text.substr(begin, end - begin));
    if (!value || *value < 0.0) return std::nullopt;
    parts[count] = *value;
    begin = end + 1;
  }
  const bool whole = parts[0] == std::floor(parts[0]) && parts[1] == std::floor(parts[1]);
  if (count < 2 || !whole || parts[1] >= 60.0 || parts[2] >= 60.0) return std::nullopt;
  return 3600.0 * parts[0] + 60.0 * parts[1] + parts[2];
}

/// Simulation time of an instant, s.
std::optional<double> instant(std::string_view text, const ClockOfDay& clock) {
  if (text.find(':') == std::string_view::npos) return number(text);
  const auto of_day = seconds_of_day(text);
  if (!of_day) return std::nullopt;
  // Midnight before the epoch, on this clock. Whole nanoseconds keep full seconds exact.
  constexpr std::int64_t kDayNs = 86'400'000'000'000;
  const std::int64_t clock_ns =
      clock.epoch_utc_ns + static_cast<std::int64_t>(std::llround(3600e9 * clock.utc_offset_h));
  const std::int64_t since_midnight_ns = ((clock_ns % kDayNs) + kDayNs) % kDayNs;
  return *of_day - 1e-9 * static_cast<double>(since_midnight_ns);
}

/// Length of a step, s.
std::optional<double> step(std::string_view text) {
  constexpr std::array<std::pair<std::string_view, double>, 4> kUnits{
      {{"min", 60.0}, {"s", 1.0}, {"h", 3600.0}, {"d", kDayS}}};
  double unit_s = 1.0;
  for (const auto& [unit, length_s] : kUnits) {
    if (!text.ends_with(unit)) continue;
    text.remove_suffix(unit.size());
    unit_s = length_s;
    break;
  }
  const auto value = number(trimmed(text));
  if (!value || *value <= 0.0) return std::nullopt;
  return *value * unit_s;
}

tl::unexpected<physics::Error> refused(std::string_view entry, const std::string& reason) {
  return make_error(ErrorCode::invalid_argument, fmt::format("'{}': {}", entry, reason));
}

Result<void> add_entry(std::string_view entry, const ClockOfDay& clock, std::vector<double>& out) {
  constexpr const char* kInstant =
      "an instant is seconds since the epoch, such as 12600, or HH:MM[:SS]";
  const std::size_t dots = entry.find("..");
  if (dots == std::string_view::npos) {
    const auto time_s = instant(entry, clock);
    if (!time_s) return refused(entry, kInstant);
    out.push_back(*time_s);
    return {};
  }
  const std::size_t slash = entry.find('/', dots);
  if (slash == std::string_view::npos) {
    return refused(entry, "the step is missing: FIRST..LAST/STEP, such as 06:00..20:00/10min");
  }
  const auto first = instant(trimmed(entry.substr(0, dots)), clock);
  const auto last = instant(trimmed(entry.substr(dots + 2, slash - dots - 2)), clock);
  if (!first || !last) return refused(entry, kInstant);
  const auto step_s = step(trimmed(entry.substr(slash + 1)));
  if (!step_s) return refused(entry, "a step is a positive number with s, min, h or d");
  if (*last < *first) {
    return refused(entry, "the range ends before it begins; hours after midnight count on from 24");
  }
  // A last instant that rounding moves by a nanosecond still belongs to the range.
  const double steps = std::floor((*last - *first) / *step_s + 1e-9);
  if (steps >= static_cast<double>(kMaxTimes)) {
    return refused(entry, fmt::format("more than {} instants", kMaxTimes));
  }
  for (std::size_t i = 0; i <= static_cast<std::size_t>(steps); ++i) {
    out.push_back(*first + static_cast<double>(i) * *step_s);
  }
  return {};
}

}  // namespace

Result<std::vector<double>> parse_times(std::string_view text, const ClockOfDay& clock) {
  std::vector<double> times_s;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string_view entry = trimmed(text.substr(begin, end - begin));
    if (auto added = add_entry(entry, clock, times_s); !added) {
      return tl::unexpected(added.error());
    }
    begin = end + 1;
  }
  for (double& time_s : times_s) {
    // Steps such as 0.1 s add up with rounding; instants are whole nanoseconds.
    time_s = std::round(time_s * 1e9) / 1e9;
    if (std::abs(time_s) > physics::limits::kMaxSimTimeS) {
      return refused(text,
                     fmt::format("{} s is out of range, must be {} .. {}", time_s,
                                 -physics::limits::kMaxSimTimeS, physics::limits::kMaxSimTimeS));
    }
  }
  std::ranges::sort(times_s);
  times_s.erase(std::unique(times_s.begin(), times_s.end()), times_s.end());
  if (times_s.size() > kMaxTimes) {
    return refused(text, fmt::format("more than {} instants", kMaxTimes));
  }
  return times_s;
}

std::string utc_text(std::int64_t epoch_utc_ns, double time_s) {
  const auto seconds = static_cast<std::time_t>(
      std::floor(1e-9 * static_cast<double>(epoch_utc_ns) + std::round(time_s * 1e3) / 1e3));
  std::tm parts{};
  ::gmtime_r(&seconds, &parts);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text.data();
}

}  // namespace emit::tool
