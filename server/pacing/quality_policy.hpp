// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/renderer/renderer.hpp"

namespace emit::server {

/// Which rung of the quality ladder a frame is rendered with, so that it is ready in time: the one
/// with the least error among those whose expected time fits, else the fastest. The expected time
/// is that of full quality, an average of the latest frames judged from the rungs they had, times
/// the rung's cost, plus the most by which one of the latest frames took longer than expected: what
/// disturbs a machine does not grow with the work. Pure. RT-safe.
class QualityPolicy {
 public:
  /// `rungs`: what each costs and gets wrong in the frame that is next; not empty, [0] is full
  /// quality. `available_ns`: from now until the frame is due; <= 0: too late for any.
  [[nodiscard]] std::size_t choose(std::span<const renderer::RungStats> rungs,
                                   std::int64_t available_ns) const noexcept {
    const double spare_ns = kUsedFrac * static_cast<double>(available_ns) - excess_ns();
    std::size_t best = rungs.size();
    std::size_t fastest = 0;
    for (std::size_t i = 0; i < rungs.size(); ++i) {
      if (rungs[i].cost_frac < rungs[fastest].cost_frac) fastest = i;
      if (full_ns_ * rungs[i].cost_frac > spare_ns) continue;
      if (best == rungs.size() || rungs[i].error_k < rungs[best].error_k) best = i;
    }
    return best < rungs.size() ? best : fastest;
  }

  /// A frame was ready `work_ns` after its begin, with a rung of that cost.
  void finished(std::int64_t work_ns, double cost_frac) noexcept {
    const auto work = static_cast<double>(work_ns);
    const double cost = std::max(cost_frac, 1e-3);
    if (count_ == 0) full_ns_ = work / cost;
    excess_ns_[next_] = work - full_ns_ * cost;
    next_ = (next_ + 1) % excess_ns_.size();
    count_ = std::min(count_ + 1, excess_ns_.size());
    full_ns_ += kFollow * (work / cost - full_ns_);
  }

 private:
  /// Of so many frames alike the next one takes longer than all with a chance of one in a hundred.
  static constexpr std::size_t kRemembered = 100;
  /// Of the time there is: costs are measured, and no better than this.
  static constexpr double kUsedFrac = 0.92;
  /// Share of what a frame tells of the next: the camera moves on within some ten frames.
  static constexpr double kFollow = 0.1;

  [[nodiscard]] double excess_ns() const noexcept {
    double largest_ns = 0.0;
    for (std::size_t i = 0; i < count_; ++i) largest_ns = std::max(largest_ns, excess_ns_[i]);
    return largest_ns;
  }

  std::array<double, kRemembered> excess_ns_{};
  double full_ns_ = 0.0;
  std::size_t next_ = 0;
  std::size_t count_ = 0;
};

}  // namespace emit::server
