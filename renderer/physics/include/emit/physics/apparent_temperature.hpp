// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "emit/physics/planck.hpp"

namespace emit::physics {

/// Temperature of the blackbody that radiates as much in a band, from a table: within 0.02 K from
/// 150 to 3000 K, whose ends stand for everything beyond.
class ApparentTemperature {
 public:
  /// Setup only.
  explicit ApparentTemperature(const Band& band);

  [[nodiscard]] float k(float radiance_w_m2_sr) const noexcept;

  /// RMS difference of two pictures of the band, K. Of equal size, not empty.
  [[nodiscard]] double rms_difference_k(std::span<const float> a_w_m2_sr,
                                        std::span<const float> b_w_m2_sr) const noexcept;

 private:
  std::size_t first_ = 0;      ///< index of the first node's radiance
  std::vector<float> node_k_;  ///< at radiances with the same leading bits
};

}  // namespace emit::physics
