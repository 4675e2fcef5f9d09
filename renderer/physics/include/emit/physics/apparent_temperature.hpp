// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "emit/physics/planck.hpp"

namespace emit::physics {

/// A table that converts the in-band radiance of a blackbody to its temperature in K.
/// The error is within 0.02 K from 150 to 3000 K. Radiances outside that range give its nearest
/// end. Any thread after construction. Real time: RT-safe, except the constructor.
class ApparentTemperature {
 public:
  /// Builds the table of `band`. Setup only: it allocates and integrates Planck's law (physics.md
  /// eq. 7) some ten thousand times.
  /// @pre validate(band)
  explicit ApparentTemperature(const Band& band);

  /// Returns the temperature in K. A radiance that is NaN or not positive gives the lowest entry.
  [[nodiscard]] float k(float radiance_w_m2_sr) const noexcept;

  /// Returns the RMS difference in K of two images of the band, given as radiances in W m-2 sr-1.
  /// Pixels of equal radiance count as equal, also where the table ends.
  /// @pre the images are of equal size and not empty.
  [[nodiscard]] double rms_difference_k(std::span<const float> a_w_m2_sr,
                                        std::span<const float> b_w_m2_sr) const noexcept;

 private:
  std::size_t first_ = 0;      ///< index of the first node's radiance
  std::vector<float> node_k_;  ///< temperatures in K at radiances with the same leading bits
};

}  // namespace emit::physics
