// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/dis/clock.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"

namespace emit::protocol::dis {
namespace {

constexpr std::int64_t kNsPerHour = 3'600'000'000'000;
// An hour is a whole number of ns per unit plus a rest; their products with units fit 64 bits.
constexpr std::int64_t kWholeNsPerUnit = kNsPerHour / kUnitsPerHour;
constexpr std::int64_t kRestNs = kNsPerHour % kUnitsPerHour;

[[nodiscard]] std::int64_t units_of(std::uint32_t timestamp) noexcept {
  // The largest stamp is the full hour itself, which is the 0 of the next one.
  return static_cast<std::int64_t>(timestamp >> 1) % kUnitsPerHour;
}

}  // namespace

std::int64_t units_to_ns(std::int64_t units) noexcept {
  EMIT_DCHECK_OP(units, >=, 0);
  const std::int64_t hours = units / kUnitsPerHour;
  const std::int64_t rest = units % kUnitsPerHour;
  return hours * kNsPerHour + rest * kWholeNsPerUnit +
         (rest * kRestNs + kUnitsPerHour / 2) / kUnitsPerHour;
}

std::uint32_t timestamp_of(std::int64_t time_ns, bool absolute) noexcept {
  const std::int64_t past_ns = (time_ns % kNsPerHour + kNsPerHour) % kNsPerHour;
  const auto units = std::llround(static_cast<double>(past_ns) / static_cast<double>(kNsPerHour) *
                                  static_cast<double>(kUnitsPerHour));
  return static_cast<std::uint32_t>(units % kUnitsPerHour) << 1 | (absolute ? 1u : 0u);
}

DisClock::Reading DisClock::read(std::uint32_t timestamp, std::int64_t received_ns) noexcept {
  const std::int64_t units = units_of(timestamp);
  const bool absolute = is_absolute(timestamp);
  if (!started_) {
    started_ = true;
    absolute_ = absolute;
    units_ = units;
    received_ns_ = received_ns;
    return {units_to_ns(units), Order::first};
  }
  const std::int64_t gap_ns = std::max<std::int64_t>(received_ns - received_ns_, 0);
  // The nearest way round the hour, then the whole hours that the local clock saw pass.
  std::int64_t step = units - units_ % kUnitsPerHour;
  if (step > kUnitsPerHour / 2) step -= kUnitsPerHour;
  if (step < -kUnitsPerHour / 2) step += kUnitsPerHour;
  const double gap_units =
      static_cast<double>(gap_ns) / static_cast<double>(kNsPerHour) * kUnitsPerHour;
  const auto hours = std::llround((gap_units - static_cast<double>(step)) / kUnitsPerHour);
  if (hours > 0) step += hours * kUnitsPerHour;

  const std::int64_t latest_ns = origin_ns_ + units_to_ns(units_);
  if (absolute == absolute_ && step == 0) return {latest_ns, Order::duplicate};
  const bool back = step < 0;
  if (absolute == absolute_ && back && units_to_ns(-step) <= kMaxLate_ns) {
    return {latest_ns - units_to_ns(-step), Order::late};
  }
  received_ns_ = received_ns;
  if (absolute != absolute_ || back) {
    absolute_ = absolute;
    units_ = units;
    const std::int64_t now_ns = latest_ns + std::max<std::int64_t>(gap_ns, 1);
    origin_ns_ = now_ns - units_to_ns(units);
    return {now_ns, Order::restart};
  }
  units_ += step;
  return {origin_ns_ + units_to_ns(units_), Order::next};
}

}  // namespace emit::protocol::dis
