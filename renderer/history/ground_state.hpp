// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>

#include "emit/physics/climate/surface_water.hpp"
#include "emit/physics/foster.hpp"
#include "emit/renderer/heat_limits.hpp"

namespace emit::renderer {

/// Open, level ground of a material that holds rain water.
struct WaterGround {
  physics::FosterState<double> modes_k{};
  double water_mm = 0.0;

  bool operator==(const WaterGround&) const = default;
};
/// Grounds of the materials that hold water, by slot.
using WaterGrounds = std::array<WaterGround, physics::kWaterSlots>;

/// Largest number of grounds without a store of water whose temperature is watched, because they
/// are moist, snow or ice.
inline constexpr std::size_t kWatchedGrounds = 6;

/// State of the open, level ground around the scene at an instant: that of the surroundings, that
/// of the materials which hold water, by slot, and that of further ones whose temperature tells
/// what the formulae leave out.
struct GroundState {
  physics::FosterState<double> surroundings{};
  WaterGrounds water{};       ///< with all of the rain
  WaterGrounds half_water{};  ///< with half of it
  WaterGrounds sheltered{};   ///< without rain
  std::array<physics::FosterState<double>, kWatchedGrounds> watched{};
  HeatLimitTimes limits;
};

}  // namespace emit::renderer
