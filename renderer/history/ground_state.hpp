// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>

#include "emit/physics/climate/surface_water.hpp"
#include "emit/physics/foster.hpp"

namespace emit::renderer {

/// Open, level ground of a material that holds rain water.
struct WaterGround {
  physics::FosterState<double> modes_k{};
  double water_mm = 0.0;
};

/// State of the open, level ground around the scene at an instant: that of the surroundings, and
/// that of the materials which hold water, by slot.
struct GroundState {
  physics::FosterState<double> surroundings{};
  std::array<WaterGround, physics::kWaterSlots> water{};
};

}  // namespace emit::renderer
