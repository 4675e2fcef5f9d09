// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <vector>

#include "emit/physics/surface/optical_constants.hpp"

namespace emit::scene {

/// Interface of a glossy surface. Its reflectance by angle comes from optical constants or from a
/// table, and its facets spread what it reflects.
struct Gloss {
  physics::IndexTable index = physics::IndexTable::none;
  // Constants of the user's own; all three lists have the same length.
  std::vector<double> wavelength_um;
  std::vector<double> refractive_index;
  std::vector<double> extinction_index;
  // Directional emissivity of a smooth surface by the angle to the normal, in place of constants.
  std::vector<double>
      angle_rad;  ///< ascending from 0, below 90 degrees; the reflectance at 90 is 1
  std::vector<double> angle_emissivity_frac;
  double lobe_frac = 1.0;     ///< share of what the interface reflects that goes into the lobe
  double facet_slope = 0.05;  ///< width of the GGX distribution of slopes
  bool sea = false;           ///< facets are wind waves
  std::optional<double> sea_wind_m_s;  ///< absent: the wind of the weather at simulation time 0

  [[nodiscard]] bool operator==(const Gloss&) const = default;
};

}  // namespace emit::scene
