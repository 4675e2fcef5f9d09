// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <vector>

#include "surface/model/surface_model.hpp"

namespace emit::renderer {

/// What sun and sky of the past are still worth, K of today's temperature: by first differences
/// around half of what there is. Immutable; any thread.
class DriveWorth {
 public:
  explicit DriveWorth(const SurfaceInputs& inputs);

  /// Per visible share of the sun's disc times the cosine to the face, in an interval of the
  /// record; 0 at night.
  [[nodiscard]] float sun_k(std::uint32_t material, std::size_t interval) const noexcept {
    return sun_k_[material * intervals_ + interval];
  }
  /// Per share of the hemisphere that shows sky.
  [[nodiscard]] float sky_k(std::uint32_t material) const noexcept { return sky_k_[material]; }

 private:
  std::size_t intervals_ = 0;
  std::vector<float> sun_k_;  ///< by material, then interval
  std::vector<float> sky_k_;  ///< by material
};

}  // namespace emit::renderer
