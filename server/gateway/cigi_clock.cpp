// SPDX-License-Identifier: Apache-2.0
#include "gateway/cigi_clock.hpp"

#include "emit/protocol/codec.hpp"

namespace emit::server {
namespace {

/// Messages in a row that count up by one from an old number: nobody overtakes so many.
constexpr std::uint32_t kStraysOfRestart = 8;

/// Longest step of time between two messages: three years.
constexpr std::int64_t kLongestStepNs = 100'000'000'000'000'000;

/// Returns how far `to` is ahead of `from`, for numbers that wrap.
std::int32_t ahead(std::uint32_t from, std::uint32_t to) noexcept {
  return static_cast<std::int32_t>(to - from);
}

}  // namespace

void CigiClock::start(std::int64_t first_ns) noexcept {
  const std::int64_t period_ns = period_ns_;
  *this = CigiClock(period_ns);
  started_ = true;
  time_ns_ = first_ns;
}

CigiClock::Verdict CigiClock::take(const protocol::cigi::IgControl& control) noexcept {
  if (!started_) return Verdict::restart;
  if (!control.timestamp_valid && period_ns_ == 0) return Verdict::timeless;
  if (!first_) {
    const std::int32_t frames = ahead(frame_, control.host_frame);
    if (frames == 0) return Verdict::repeated;
    const std::int32_t ticks =
        control.timestamp_valid && has_ticks_ ? ahead(ticks_, control.timestamp_ticks) : 0;
    if (frames < 0 || ticks < 0) {
      const bool goes_on = strays_ > 0 && ahead(stray_frame_, control.host_frame) == 1;
      strays_ = goes_on ? strays_ + 1 : 1;
      stray_frame_ = control.host_frame;
      return strays_ >= kStraysOfRestart ? Verdict::restart : Verdict::old;
    }
    // A time stamp counts from the latest one. Where there was none since, the frames do.
    const bool by_stamp = control.timestamp_valid && has_ticks_;
    if (!by_stamp && period_ns_ > 0 && frames > kLongestStepNs / period_ns_) {
      return Verdict::restart;
    }
    time_ns_ += by_stamp ? std::int64_t{ticks} * protocol::cigi::kTimestampTickNs
                         : std::int64_t{frames} * period_ns_;
    if (time_ns_ > protocol::kMaxSimTimeNs) return Verdict::restart;
    number_ += static_cast<std::uint32_t>(frames);
  } else {
    number_ = control.host_frame;
    first_ = false;
  }
  strays_ = 0;
  frame_ = control.host_frame;
  has_ticks_ = control.timestamp_valid;
  if (has_ticks_) ticks_ = control.timestamp_ticks;
  return Verdict::accept;
}

}  // namespace emit::server
