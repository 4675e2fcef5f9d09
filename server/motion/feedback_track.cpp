// SPDX-License-Identifier: Apache-2.0
#include "motion/feedback_track.hpp"

namespace emit::server {
namespace {

/// Cubic Hermite interpolation. `share` is 0 at `a` and 1 at `b`, `span_s` lies between them.
template <class Vector>
Vector between(const Vector& a, const Vector& a_rate, const Vector& b, const Vector& b_rate,
               double share, double span_s) noexcept {
  const double left = 1.0 - share;
  return left * left * (1.0 + 2.0 * share) * a + share * share * (3.0 - 2.0 * share) * b +
         share * left * span_s * (left * a_rate - share * b_rate);
}

double seconds(std::int64_t ns) noexcept {
  return 1e-9 * static_cast<double>(ns);
}

}  // namespace

bool FeedbackTrack::add(const AxisFeedback& feedback) noexcept {
  if (count_ > 0 && feedback.time_ns <= sample(count_ - 1).time_ns) return false;
  if (count_ == kSamples) {
    first_ = (first_ + 1) % kSamples;
    --count_;
  }
  samples_[(first_ + count_) % kSamples] = feedback;
  ++count_;
  return true;
}

FeedbackTrack::State FeedbackTrack::predicted(std::int64_t time_ns) const noexcept {
  const AxisFeedback& last = sample(count_ - 1);
  // Find the rates of a little earlier.
  std::size_t i = count_ - 1;
  while (i > 0 && last.time_ns - sample(i - 1).time_ns <= kAccelerationNs) --i;
  const AxisFeedback& earlier = sample(i);
  const double span_s = seconds(last.time_ns - earlier.time_ns);
  const double after_s = seconds(time_ns - last.time_ns);
  // The change of the rates is the acceleration in the middle of the span.
  const double gain_s = span_s > 0.0 ? 0.5 * after_s * after_s / span_s : 0.0;
  return {{last.angles.unit_rad + after_s * last.unit_rates_rad_s +
               gain_s * (last.unit_rates_rad_s - earlier.unit_rates_rad_s),
           last.angles.target_rad + after_s * last.target_rates_rad_s +
               gain_s * (last.target_rates_rad_s - earlier.target_rates_rad_s)},
          time_ns > last.time_ns};
}

std::optional<FeedbackTrack::State> FeedbackTrack::at(std::int64_t time_ns,
                                                      std::int64_t horizon_ns) const noexcept {
  if (count_ == 0 || time_ns < sample(0).time_ns) return std::nullopt;
  const AxisFeedback& last = sample(count_ - 1);
  if (time_ns >= last.time_ns) {
    if (time_ns - last.time_ns > horizon_ns) return std::nullopt;
    return predicted(time_ns);
  }
  // Find the two measurements around the instant, from the latest back: that is where it mostly is.
  std::size_t i = count_ - 1;
  while (sample(i - 1).time_ns > time_ns) --i;
  const AxisFeedback& a = sample(i - 1);
  const AxisFeedback& b = sample(i);
  const double span_s = seconds(b.time_ns - a.time_ns);
  const double share = seconds(time_ns - a.time_ns) / span_s;
  return State{{between(a.angles.unit_rad, a.unit_rates_rad_s, b.angles.unit_rad,
                        b.unit_rates_rad_s, share, span_s),
                between(a.angles.target_rad, a.target_rates_rad_s, b.angles.target_rad,
                        b.target_rates_rad_s, share, span_s)},
               false};
}

}  // namespace emit::server
