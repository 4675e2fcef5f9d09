// SPDX-License-Identifier: Apache-2.0
#include "axes/acutrol_table.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"

namespace emit::server {
namespace {

using physics::kDegree;
using protocol::AxesMode;
using protocol::AxesState;

/// Header of every answer. A driver for a real controller skips 8 characters.
constexpr std::string_view kHeader = "ACUTROL ";
constexpr std::string_view kLineEnd = "\r\n";
/// No rate is made of two demands that are farther apart, and none is continued for longer.
constexpr double kLongestGapS = 0.05;
constexpr std::uint32_t kSilenceMs = protocol::kMaxAxesTimeoutMs;

constexpr char lowered(char c) noexcept {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

bool is(std::string_view verb, std::string_view brief, std::string_view full) noexcept {
  return std::ranges::equal(verb, brief, {}, lowered) ||
         std::ranges::equal(verb, full, {}, lowered);
}

std::string_view trimmed(std::string_view text) noexcept {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

template <class Number>
bool whole_number(std::string_view text, Number& out) noexcept {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
  return error == std::errc() && end == text.data() + text.size();
}

}  // namespace

AcutrolTable::AcutrolTable(std::size_t axes) noexcept : count_(axes) {
  EMIT_CHECK(axes >= 1 && axes <= protocol::kMaxAxes);
  command_.timeout_ms = kSilenceMs;
  command_.count = axes;
}

void AcutrolTable::update(const protocol::AxesMonitor& monitor) noexcept {
  monitor_ = monitor;
  if (monitor.state != AxesState::fault) return;
  for (Axis& axis : axes_) axis.closed = false;
}

std::string_view AcutrolTable::say(std::string_view text) noexcept {
  char* end = std::ranges::copy(kHeader, text_.data()).out;
  end = std::ranges::copy(text, end).out;
  end = std::ranges::copy(kLineEnd, end).out;
  return {text_.data(), static_cast<std::size_t>(end - text_.data())};
}

std::string_view AcutrolTable::say(double value) noexcept {
  std::array<char, 32> digits;
  constexpr int kDigits = 6;
  const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), value,
                                          std::chars_format::fixed, kDigits);
  if (error != std::errc()) return say_error("ERROR overflow");
  return say({digits.data(), static_cast<std::size_t>(end - digits.data())});
}

std::string_view AcutrolTable::say_error(std::string_view text) noexcept {
  ++errors_;
  return say(text);
}

std::string_view AcutrolTable::answer(std::string_view line, std::int64_t now_ns) noexcept {
  // Cut ":verb:verb? axis,value" into its parts.
  line = trimmed(line);
  const std::size_t space = std::min(line.find(' '), line.size());
  std::string_view verb = line.substr(0, space);
  const std::string_view arguments = trimmed(line.substr(space));
  const std::size_t comma = std::min(arguments.find(','), arguments.size());
  const std::string_view value =
      comma < arguments.size() ? trimmed(arguments.substr(comma + 1)) : std::string_view();
  if (is(verb, ":i:r", ":interlock:reset") && arguments.empty()) {
    reset_ = reset_ || monitor_.state == AxesState::fault;
    return say("OK");
  }
  std::size_t axis = 0;
  if (!whole_number(trimmed(arguments.substr(0, comma)), axis) || axis < 1 || axis > count_) {
    return say_error("ERROR parameter out of range");
  }
  return answer(verb, axis - 1, value, now_ns);
}

std::string_view AcutrolTable::answer(std::string_view verb, std::size_t axis,
                                      std::string_view value, std::int64_t now_ns) noexcept {
  Axis& at = axes_[axis];
  if (is(verb, ":d:p", ":demand:position")) {
    double degrees = 0.0;
    if (!whole_number(value, degrees) || !(std::abs(degrees * kDegree) <= protocol::kMaxAxisRad)) {
      return say_error("ERROR parameter out of range");
    }
    demand(at, degrees * kDegree, now_ns);
    return say("OK");
  }
  if (!value.empty()) return say_error("ERROR too many parameters");
  if (is(verb, ":r:p", ":read:position") || is(verb, ":r:p?", ":read:position?")) {
    return say(monitor_.measured[axis].angle_rad / kDegree);
  }
  if (is(verb, ":r:r", ":read:rate") || is(verb, ":r:r?", ":read:rate?")) {
    return say(monitor_.measured[axis].rate_rad_s / kDegree);
  }
  if (is(verb, ":interlock?", ":int?")) {
    return say(monitor_.state == AxesState::fault ? "Fault" : at.closed ? "Close" : "Open");
  }
  if (is(verb, ":m:p", ":mode:position")) {
    at.in_position_mode = true;
    return say("OK");
  }
  if (is(verb, ":m:o", ":mode:off")) {
    at.in_position_mode = at.demanded = false;
    return say("OK");
  }
  if (is(verb, ":i:o", ":interlock:open")) {
    at.closed = false;
    return say("OK");
  }
  if (is(verb, ":i:c", ":interlock:close")) {
    if (monitor_.state == AxesState::fault) return say_error("ERROR interlock fault");
    at.closed = true;
    return say("OK");
  }
  return say_error("ERROR unknown command");
}

void AcutrolTable::demand(Axis& axis, double demand_rad, std::int64_t now_ns) noexcept {
  const double gap_s = 1e-9 * static_cast<double>(now_ns - axis.demand_ns);
  const bool goes_on = axis.demanded && gap_s > 0.0 && gap_s <= kLongestGapS;
  // Far demands one after the other are no motion that an axis could have.
  const double rate_rad_s = goes_on ? (demand_rad - axis.demand_rad) / gap_s : 0.0;
  axis.rate_rad_s = std::abs(rate_rad_s) <= protocol::kMaxAxisRadS ? rate_rad_s : 0.0;
  axis.gap_s = goes_on ? gap_s : 0.0;
  axis.demand_rad = demand_rad;
  axis.demand_ns = now_ns;
  axis.demanded = true;
}

const protocol::AxesCommand& AcutrolTable::command(std::int64_t now_ns) noexcept {
  bool follow = !reset_;
  for (std::size_t i = 0; i < count_; ++i) {
    const Axis& axis = axes_[i];
    follow = follow && axis.in_position_mode && axis.closed && axis.demanded;
    // A demand is continued until two more were due, and stands as it is when none comes.
    const double since_s = 1e-9 * static_cast<double>(now_ns - axis.demand_ns);
    const bool goes_on = since_s <= 2.0 * axis.gap_s;
    const double on_s = since_s <= kLongestGapS ? std::clamp(since_s, 0.0, 2.0 * axis.gap_s) : 0.0;
    const double angle_rad = std::clamp(axis.demand_rad + axis.rate_rad_s * on_s,
                                        -protocol::kMaxAxisRad, protocol::kMaxAxisRad);
    command_.axes[i] = {angle_rad, goes_on ? axis.rate_rad_s : 0.0, 0.0};
  }
  command_.mode = follow ? AxesMode::follow : AxesMode::off;
  ++command_.counter;
  command_.time_ns = now_ns;
  reset_ = false;
  return command_;
}

}  // namespace emit::server
