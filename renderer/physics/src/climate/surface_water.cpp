// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/climate/surface_water.hpp"

#include <algorithm>
#include <cmath>

namespace emit::physics {
namespace {

constexpr double kFilmPower = 2.0 / 3.0;
/// Longest part of a step with rain, whose filling and drying take turns, and the most parts.
constexpr double kRainPartS = 60.0;
constexpr int kMostParts = 64;

/// Returns what is left of a store after `open_mm` have evaporated from a surface that stays wet
/// all over: the exact solution of S' = -E w(S).
double dried_mm(const WaterStore& store, double water_mm, double open_mm) noexcept {
  if (store.kind == WaterStore::Kind::film) {
    // S^(1/3) falls at an even rate.
    const double root =
        std::cbrt(water_mm) - open_mm / (3.0 * std::pow(store.capacity_mm, kFilmPower));
    return root > 0.0 ? root * root * root : 0.0;
  }
  // The first stage is straight, the second one exponential.
  const double slow_mm = store.capacity_mm - store.ready_mm;
  const double first_mm = std::clamp(water_mm - slow_mm, 0.0, open_mm);
  return (water_mm - first_mm) * std::exp(-(open_mm - first_mm) / slow_mm);
}

}  // namespace

double wet_frac(const WaterStore& store, double water_mm) noexcept {
  if (store.none() || !(water_mm > 0.0)) return 0.0;
  if (store.kind == WaterStore::Kind::soil) {
    return std::min(1.0, water_mm / (store.capacity_mm - store.ready_mm));
  }
  const double root = std::cbrt(std::min(1.0, water_mm / store.capacity_mm));
  return root * root;
}

double soil_water_mm(const WaterStore& store, double wetness_frac) noexcept {
  if (wetness_frac >= 1.0) return store.capacity_mm;
  return std::max(0.0, wetness_frac) * (store.capacity_mm - store.ready_mm);
}

StoredWater advance_water(const WaterStore& store, double water_mm, double rain_mm,
                          double open_mm_s, double dt_s) noexcept {
  StoredWater out{.water_mm = water_mm};
  if (store.none()) {
    out.drained_mm = rain_mm;
    return out;
  }
  const auto fill = [&](double mm) {
    const double taken_mm = std::min(mm, store.capacity_mm - out.water_mm);
    out.water_mm += taken_mm;
    out.drained_mm += mm - taken_mm;
  };
  const int parts =
      rain_mm > 0.0 ? std::clamp(static_cast<int>(std::ceil(dt_s / kRainPartS)), 1, kMostParts) : 1;
  const double open_mm = open_mm_s * dt_s / parts;
  const double half_mm = 0.5 * rain_mm / parts;
  for (int part = 0; part < parts; ++part) {
    fill(half_mm);
    if (open_mm > 0.0) {
      const double left_mm = dried_mm(store, out.water_mm, open_mm);
      out.evaporated_mm += out.water_mm - left_mm;
      out.water_mm = left_mm;
    } else if (out.water_mm > 0.0) {
      // Dew forms on what is wet.
      const double taken_mm = std::min(-open_mm, store.capacity_mm - out.water_mm);
      out.evaporated_mm -= taken_mm;
      out.water_mm += taken_mm;
    }
    fill(half_mm);
  }
  return out;
}

}  // namespace emit::physics
