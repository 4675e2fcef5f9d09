// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>

#include "emit/physics/sky/moon.hpp"
#include "emit/physics/sun.hpp"
#include "emit/reference/solve.hpp"
#include "emit/reference/surface_forcing.hpp"
#include "solve_radiance.hpp"

namespace emit::reference {

/// Discs of sun and moon in the sky, by rays within each pixel: a ray meets the ball of the moon,
/// or else the disc of the sun.
struct SkyDiscs {
  physics::SunPosition sun;
  physics::MoonPosition moon;
  double beam_frac = 0.0;                   ///< share of a clear sky's direct sun that shines
  const SurfaceClimate* climate = nullptr;  ///< with its broken clouds, if there are any
  ClimateNode now;                          ///< climate at the instant

  /// Returns what the discs add to a pixel of the sky, W m-2 sr-1.
  [[nodiscard]] double radiance_w_m2_sr(const BandRadiance& band, const SolveView& view,
                                        std::size_t pixel) const;
};

}  // namespace emit::reference
