// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "emit/renderer/renderer.hpp"

namespace emit::server {

/// Choice of the quality level with which a frame is ready in time: the one with the least error
/// among those whose expected time fits. If none fits, it is the one with the least error among
/// those that are about as fast as the fastest: a device whose frames take the same time at every
/// level would give its quality away for nothing. A frame is expected to take what the
/// ladder measured for its level and camera, at the machine's present pace, plus what every frame
/// takes beside it (both fitted to the latest frames), plus an excess that about one frame in 128
/// goes beyond. So about one frame in 128 is late, one in 64 at most, if the next ones are like the
/// latest. Pure. RT-safe.
class QualityPolicy {
 public:
  /// `quality_levels`: what each costs and gets wrong in the frame that is next; not empty, [0] is
  /// full quality. `available_ns`: from now until the frame is due; <= 0: too late for any.
  [[nodiscard]] std::size_t choose(std::span<const renderer::QualityLevelStats> quality_levels,
                                   std::int64_t available_ns) const noexcept {
    const double spare_ms = kUsedFrac * 1e-6 * static_cast<double>(available_ns) - excess_ms();
    const auto within = best_within(quality_levels, spare_ms);
    if (within) return *within;
    double fastest_ms = expected_ms(quality_levels.front().frame_ms);
    for (const renderer::QualityLevelStats& level : quality_levels) {
      fastest_ms = std::min(fastest_ms, expected_ms(level.frame_ms));
    }
    return best_within(quality_levels, fastest_ms + kWorthlessFrac * std::abs(fastest_ms))
        .value_or(0);
  }

  /// Takes note of a frame that was ready `work_ns` after its begin. `level_ms` is
  /// QualityLevelStats::frame_ms of its quality level.
  void finished(std::int64_t work_ns, double level_ms) noexcept {
    const double work_ms = 1e-6 * static_cast<double>(work_ns);
    excess_ms_[next_] = static_cast<float>(work_ms - expected_ms(level_ms));
    next_ = (next_ + 1) % excess_ms_.size();
    count_ = std::min(count_ + 1, excess_ms_.size());
    fit(work_ms, level_ms);
  }

 private:
  /// Enough to tell a disturbance that comes again and again from one that came once.
  static constexpr std::size_t kRemembered = 512;
  /// Number of frames that are remembered. The next frame takes longer than all of them with a
  /// chance of one in this number.
  static constexpr std::size_t kFramesPerLate = 128;
  /// Part of the time left that a frame may use, because costs are measured no better than this.
  static constexpr double kUsedFrac = 0.92;
  /// A frame that is late in any case is not made faster by less than this part.
  static constexpr double kWorthlessFrac = 0.1;
  /// Weight of a frame in the fit one frame later, relative to before.
  static constexpr double kKept = 0.95;
  /// The ladder's own word (pace 1, nothing beside) counts as this many frames.
  static constexpr double kPrior = 0.5;
  /// Limits of the pace. Beyond them the work does not follow the times of the levels, and all of
  /// it counts as beside.
  static constexpr double kMinPace = 0.25;
  static constexpr double kMaxPace = 4.0;

  [[nodiscard]] double expected_ms(double level_ms) const noexcept {
    return pace_ * level_ms + beside_ms_;
  }

  /// Returns the level with the least error among those that are expected to take `most_ms` at
  /// most.
  [[nodiscard]] std::optional<std::size_t> best_within(
      std::span<const renderer::QualityLevelStats> quality_levels, double most_ms) const noexcept {
    std::optional<std::size_t> best;
    for (std::size_t i = 0; i < quality_levels.size(); ++i) {
      if (expected_ms(quality_levels[i].frame_ms) > most_ms) continue;
      if (!best || quality_levels[i].error_k < quality_levels[*best].error_k) best = i;
    }
    return best;
  }

  /// Returns the excess, ms, that one remembered frame in kFramesPerLate exceeds. It is not more
  /// than the largest one of the latest kFramesPerLate frames, so that a single event is soon
  /// forgotten, and never negative.
  [[nodiscard]] double excess_ms() const noexcept {
    std::array<float, kRemembered / kFramesPerLate> largest_ms{};  // of all, in order
    float latest_ms = 0.0F;
    for (std::size_t age = 0; age < count_; ++age) {
      float ms = excess_ms_[(next_ + kRemembered - 1 - age) % kRemembered];
      if (age < kFramesPerLate) latest_ms = std::max(latest_ms, ms);
      for (float& place_ms : largest_ms) {
        if (ms > place_ms) std::swap(ms, place_ms);
      }
    }
    const std::size_t sought = std::max<std::size_t>(count_ / kFramesPerLate, 1);
    return std::min(latest_ms, largest_ms[sought - 1]);
  }

  /// Least squares of work = pace * level_ms + beside, older frames fading, drawn towards pace 1.
  void fit(double work_ms, double level_ms) noexcept {
    for (double* sum : {&n_, &r_, &rr_, &w_, &rw_}) *sum *= kKept;
    n_ += 1.0;
    r_ += level_ms;
    rr_ += level_ms * level_ms;
    w_ += work_ms;
    rw_ += level_ms * work_ms;
    const double prior_rr = kPrior * rr_ / n_;
    const double a = rr_ + prior_rr;
    const double d = n_ + kPrior;
    const double determinant = a * d - r_ * r_;
    if (determinant <= 0.0) return;  // levels without a time: nothing was measured
    pace_ = std::clamp(((rw_ + prior_rr) * d - w_ * r_) / determinant, kMinPace, kMaxPace);
    beside_ms_ = (w_ - pace_ * r_) / d;
  }

  std::array<float, kRemembered> excess_ms_{};
  std::size_t next_ = 0;
  std::size_t count_ = 0;
  double pace_ = 1.0;
  double beside_ms_ = 0.0;
  // Fading sums over frames: weight, level_ms, level_ms squared, work, level_ms times work.
  double n_ = 0.0;
  double r_ = 0.0;
  double rr_ = 0.0;
  double w_ = 0.0;
  double rw_ = 0.0;
};

}  // namespace emit::server
