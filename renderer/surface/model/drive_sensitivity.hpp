// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "emit/physics/check.hpp"
#include "surface/model/surface_model.hpp"

namespace emit::renderer {

/// Sensitivity of today's temperature to the sun and the sky of the past, in kelvin, for every
/// material. It is a finite difference around half of the sun in every interval and half of the
/// sky. It is computed once at the warm-up: the time grows with the number of materials and with
/// the square of the number of intervals. Immutable; any thread.
class DriveSensitivity {
 public:
  explicit DriveSensitivity(const SurfaceInputs& inputs);

  /// Returns the kelvins that the whole sun of interval `interval` of the record, at normal
  /// incidence, adds to the temperature at the end of the record. For another face multiply by the
  /// visible share of the disc and by the cosine of incidence. It is 0 where the sun is down.
  /// @pre `material` and `interval` exist
  [[nodiscard]] float sun_k(std::uint32_t material, std::size_t interval) const noexcept {
    EMIT_DCHECK_OP(material, <, sky_k_.size());
    EMIT_DCHECK_OP(interval, <, intervals_);
    return sun_k_[material * intervals_ + interval];
  }
  /// Returns the kelvins that a hemisphere full of sky, seen throughout the record in place of
  /// surroundings, adds to the temperature at its end. For a part of the hemisphere multiply by its
  /// share.
  /// @pre `material` exists
  [[nodiscard]] float sky_k(std::uint32_t material) const noexcept {
    EMIT_DCHECK_OP(material, <, sky_k_.size());
    return sky_k_[material];
  }

 private:
  std::size_t intervals_ = 0;
  std::vector<float> sun_k_;  ///< by material, then interval
  std::vector<float> sky_k_;  ///< by material
};

}  // namespace emit::renderer
