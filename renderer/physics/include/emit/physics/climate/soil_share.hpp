// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/physics/climate/surface_water.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/physics/saturation.hpp"

namespace emit::physics {

/// Returns what the part of a store that evaporates per wetness falls by, 0..1: MoistSurface's
/// film_frac is the wetness times this (physics.md eq. 65). A film shares the temperature of its
/// surface, so that it is 1. The wetness of soil is a share of what wet soil would give, which is
/// cooler; by the equation of Penman and Monteith the soil itself gives as much with a resistance.
/// Any thread. RT-safe.
/// @pre 0 <= wetness_frac <= 1
[[nodiscard]] inline double warm_soil_factor(const WaterStore& store, double wetness_frac,
                                             double air_k, const MoistAir& air) noexcept {
  if (store.kind != WaterStore::Kind::soil) return 1.0;
  const double rise = saturation(air_k).slope_pa_k / air.psychrometric_pa_k;
  return 1.0 / (1.0 + rise * (1.0 - wetness_frac));
}

}  // namespace emit::physics
