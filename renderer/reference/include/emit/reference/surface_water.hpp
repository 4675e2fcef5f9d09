// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/climate/surface_water.hpp"
#include "emit/reference/surface_forcing.hpp"

/// Rain water of open, level ground over a climate, by small steps of heat and water together. It
/// has the balance of physics.md section 8 and shares no formula with the real-time path.
namespace emit::reference {

/// Water of the ground of a material at the nodes of a climate; empty where it never holds any.
struct WaterCourse {
  std::vector<std::int64_t> time_ns;
  std::vector<double> water_mm;
  std::vector<double> wet_frac;  ///< share of what ground as warm and wet all over would give
  std::vector<double> face_k;    ///< temperature of the ground
  double evaporated_mm = 0.0;    ///< in all, less the dew
  double drained_mm = 0.0;       ///< in all: what the store could not take

  [[nodiscard]] bool empty() const noexcept { return time_ns.empty(); }
  /// Returns the wetness at an instant: linear between nodes, 0 for an empty course.
  [[nodiscard]] double at(std::int64_t at_ns) const noexcept;
};

/// Computes the course from the steady profile between `initial_k` and the base.
/// @pre nodes is not empty
[[nodiscard]] WaterCourse water_course(std::span<const ClimateNode> nodes,
                                       const scene::Material& material, double initial_k,
                                       double surroundings_reflectance_frac, const LayerMesh& mesh,
                                       const StepOptions& steps = {});

}  // namespace emit::reference
