// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "emit/scene/gas_desc.hpp"

/// Description of the small-scale variation of a material.
namespace emit::scene {

/// Variation of a material from place to place: a random field of mean 0 and variance 1 over its
/// surfaces, and what it changes per standard deviation (renderer/docs/clutter.md).
struct Clutter {
  /// Largest magnitude of the field; beyond it the field is cut.
  static constexpr double kMostSd = 4.0;
  /// Texels along the edge of the tile of the field, and in its shortest wavelength.
  static constexpr std::size_t kSide = 1024;
  static constexpr double kTexelsPerWave = 4.0;
  /// Most ratio of the longest to the shortest wavelength: an eighth of the tile.
  static constexpr double kMostRatio = 32.0;

  double shortest_m = 0.25;
  double longest_m = 4.0;
  double slope = 3.0;  ///< the power spectral density goes with k^-slope
  std::uint64_t seed = 1;
  double solar_absorptance_sd_frac = 0.0;
  double emissivity_sd_frac = 0.0;  ///< of the total, and of the bands that are not listed
  std::vector<BandValue> band_emissivity_sd_frac;
  /// Change of the natural logarithm of the thermal inertia, at the same diffusivity.
  double inertia_sd_ln = 0.0;

  /// Edge of the tile of the field, which repeats.
  [[nodiscard]] double period_m() const noexcept {
    return shortest_m * static_cast<double>(kSide) / kTexelsPerWave;
  }
  /// True if it changes temperatures, and not only emissivities in bands.
  [[nodiscard]] bool changes_heat() const noexcept {
    return solar_absorptance_sd_frac != 0.0 || emissivity_sd_frac != 0.0 || inertia_sd_ln != 0.0;
  }
};

/// Returns the change of the emissivity in a band per standard deviation.
[[nodiscard]] inline double emissivity_sd_frac(const Clutter& clutter, std::string_view band) {
  for (const BandValue& entry : clutter.band_emissivity_sd_frac) {
    if (entry.band == band) return entry.value;
  }
  return clutter.emissivity_sd_frac;
}

}  // namespace emit::scene
