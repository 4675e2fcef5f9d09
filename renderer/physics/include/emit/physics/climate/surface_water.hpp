// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>

/// Rain water on and in surfaces, and how it dries (physics.md eq. 61 to 64). Raw SI numbers, water
/// as depth in mm, which is kg m-2. Any thread. RT-safe.
namespace emit::physics {

/// Room for rain water of a material.
struct WaterStore {
  enum class Kind : std::uint8_t {
    film,  ///< water on something tight or on leaves, which breaks up as it dries
    soil,  ///< water in the top layer of soil, which evaporates freely at first
  };
  Kind kind = Kind::film;
  double capacity_mm = 0.0;  ///< what the material holds at most; 0: it holds none
  double ready_mm = 0.0;     ///< soil: part that evaporates as freely as open water, < capacity_mm
  double initial_mm = 0.0;   ///< at the start of the spin-up, 0..capacity_mm

  [[nodiscard]] bool none() const noexcept { return !(capacity_mm > 0.0); }
  bool operator==(const WaterStore&) const = default;
};

/// Returns the share of the evaporation of a surface that is wet all over, 0..1: (S/C)^(2/3) of a
/// film (Deardorff 1978), and of soil what FAO-56 eq. 74 gives for the depth that has evaporated.
[[nodiscard]] double wet_frac(const WaterStore& store, double water_mm) noexcept;
/// Returns the water at which a soil has a wetness, mm: the inverse of wet_frac() below 1. At 1 the
/// soil is full.
/// @pre store.kind is soil
[[nodiscard]] double soil_water_mm(const WaterStore& store, double wetness_frac) noexcept;

/// Water after a step, and where the rest went. Rain and what was there before add up to the three.
struct StoredWater {
  double water_mm = 0.0;
  double evaporated_mm = 0.0;  ///< below 0: dew
  double drained_mm = 0.0;     ///< ran off a tight surface, or went down into soil
};
/// Advances the water of a surface by `dt_s` seconds with an even rain of `rain_mm` in all.
/// `open_mm_s` is what a surface that is wet all over would give to the air, mm/s; below 0 it is
/// the dew that forms on all of it. Without rain the step is exact, with rain it is of second
/// order.
/// @pre dt_s >= 0, rain_mm >= 0 and 0 <= water_mm <= store.capacity_mm
[[nodiscard]] StoredWater advance_water(const WaterStore& store, double water_mm, double rain_mm,
                                        double open_mm_s, double dt_s) noexcept;

/// Vertical part of a normal up to which a face counts as a wall, on which hardly any rain falls:
/// nobody need say what rain does to it.
inline constexpr double kRainTiltCosine = 0.17;

/// Number of grounds of a scene whose water is followed. Further materials share that of the
/// material whose store is most alike, further twins of clutter that of their mean.
inline constexpr std::size_t kWaterSlots = 8;

}  // namespace emit::physics
