// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <span>
#include <vector>

namespace emit::renderer {

/// Accelerator of a fixed-point iteration x = g(x): Anderson's mixing of the latest steps (Walker
/// and Ni, SIAM J. Numer. Anal. 49, 2011, type II). Plain steps shrink the error by the share of
/// radiation that comes back; in a closed box of low emissivity that is 0.98 a step, and mixing
/// takes tens of steps where plain ones take hundreds. Setup only: it allocates and uses all cores.
/// The result does not depend on the number of cores.
class FixedPointMixer {
 public:
  /// Number of earlier steps that are mixed.
  static constexpr std::size_t kDepth = 5;

  /// Forgets all steps.
  void reset() noexcept {
    steps_ = 0;
    first_ = true;
  }
  /// Takes a point `x` and its image `g` = g(x), and replaces `g` by the next point to try.
  /// @pre `x` and `g` have the same length in all calls after a reset()
  void mix(std::span<const float> x, std::span<float> g);

 private:
  std::size_t steps_ = 0;  ///< steps in the history
  bool first_ = true;
  std::vector<float> last_off_;  ///< g(x) - x of the latest call
  std::vector<float> last_image_;
  std::vector<std::vector<float>> off_steps_;    ///< differences of g(x) - x, in a ring
  std::vector<std::vector<float>> image_steps_;  ///< differences of g(x), in the same order
};

}  // namespace emit::renderer
