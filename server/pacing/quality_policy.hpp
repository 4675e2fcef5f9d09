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
/// with the least error among those whose expected time fits, else the fastest. Time of a frame at
/// full quality is expected to be no more than the most that the latest frames would have taken,
/// judged from the rungs they had. Pure. RT-safe.
class QualityPolicy {
 public:
  /// `rungs`: what each costs and gets wrong in the frame that is next; not empty, [0] is full
  /// quality. `available_ns`: from now until the frame is due; <= 0: too late for any.
  [[nodiscard]] std::size_t choose(std::span<const renderer::RungStats> rungs,
                                   std::int64_t available_ns) const noexcept {
    const double full_ns = kMargin * expected_full_ns();
    std::size_t best = rungs.size();
    std::size_t fastest = 0;
    for (std::size_t i = 0; i < rungs.size(); ++i) {
      if (rungs[i].cost_frac < rungs[fastest].cost_frac) fastest = i;
      if (full_ns * rungs[i].cost_frac > static_cast<double>(available_ns)) continue;
      if (best == rungs.size() || rungs[i].error_k < rungs[best].error_k) best = i;
    }
    return best < rungs.size() ? best : fastest;
  }

  /// A frame was ready `work_ns` after its begin, with a rung of that cost.
  void finished(std::int64_t work_ns, double cost_frac) noexcept {
    latest_ns_[next_] = static_cast<double>(work_ns) / std::max(cost_frac, 1e-3);
    next_ = (next_ + 1) % latest_ns_.size();
    count_ = std::min(count_ + 1, latest_ns_.size());
  }

  /// The most that a frame at full quality has taken lately, ns; 0 before the first.
  [[nodiscard]] double expected_full_ns() const noexcept {
    return count_ == 0 ? 0.0 : *std::max_element(latest_ns_.begin(), latest_ns_.begin() + count_);
  }

  void reset() noexcept { count_ = next_ = 0; }

 private:
  /// Of so many frames alike the next one takes longer than all with a chance of one in a hundred.
  static constexpr std::size_t kRemembered = 100;
  static constexpr double kMargin = 1.02;

  std::array<double, kRemembered> latest_ns_{};
  std::size_t next_ = 0;
  std::size_t count_ = 0;
};

}  // namespace emit::server
