// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "emit/reference/surface_forcing.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

/// Notes about what the formulae for moisture, snow and air leave out of a solution. Setup only.
namespace emit::reference {

/// Returns the limits that the weather passes with the materials of a scene: snowfall, humidity
/// that is not stated, wind beyond the measurements of the film, rain on materials without a store.
[[nodiscard]] std::vector<std::string> weather_limits(const scene::ScenarioDesc& scenario,
                                                      const scene::SceneGeometry& geometry,
                                                      std::span<const ClimateNode> nodes);

/// Place of a solution, and its temperature.
struct SolvedPlace {
  std::uint32_t material = 0;
  double kelvin = 0.0;
};
/// Returns the materials that are moist below 0 C, or snow or ice above it, at solved places.
[[nodiscard]] std::vector<std::string> temperature_limits(const scene::ScenarioDesc& scenario,
                                                          const scene::SceneGeometry& geometry,
                                                          std::span<const SolvedPlace> places,
                                                          std::int64_t sim_time_ns);

}  // namespace emit::reference
