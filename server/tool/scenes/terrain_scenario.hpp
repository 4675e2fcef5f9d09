// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <optional>
#include <string>

#include "emit/scenegen/terrain.hpp"
#include "tool/scenes/scene_skeleton.hpp"

namespace emit::tool {

/// Values of the scenario of a terrain.
struct TerrainScenario {
  std::string name;
  std::string gltf;    ///< as the file names it
  std::string source;  ///< one line on the heights, for a comment
  std::string epoch_utc;
  std::string material;  ///< of the surroundings
  double lat_deg = 0.0;
  double lon_deg = 0.0;
  double height_m = 0.0;
  glm::dvec3 eye_world_m{0.0};
  glm::dvec3 look_at_world_m{0.0};
  std::uint64_t vertices = 0;
  std::optional<SkeletonWeather> weather;  ///< none: the climate of the place
};

/// Returns the point that a camera at `eye_world_m` looks at, so that the vertex with the highest
/// elevation angle that is not near is in the upper half of its picture. Where the ground is flat,
/// the horizon in the north is.
[[nodiscard]] glm::dvec3 terrain_view_m(const scenegen::Terrain& terrain,
                                        const glm::dvec3& eye_world_m, double radius_m);

/// Returns the scenario as TOML, with comments.
[[nodiscard]] std::string terrain_scenario_text(const TerrainScenario& scenario);

}  // namespace emit::tool
