// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <glm/ext/vector_double3.hpp>
#include <string>
#include <vector>

#include "emit/renderer/renderer.hpp"
#include "emit/scene/scene_desc.hpp"

/// Small scenes for tests of the renderer. They are written as glTF and loaded like any other
/// scene.
namespace emit::test {

/// Flat face with four corners in world axes (east, north, up), counter-clockwise when seen from
/// outside.
struct Quad {
  glm::dvec3 a, b, c, d;
};

/// Ground rectangle centred on the origin at height 0, facing up.
[[nodiscard]] Quad ground(double half_east_m, double half_north_m, double up_m = 0.0);
/// Faces of an upright box between two corners, without the bottom.
[[nodiscard]] std::vector<Quad> box(const glm::dvec3& low, const glm::dvec3& high);

/// Writes the quads as `name`.gltf into the folder of the running test and returns the file's path.
[[nodiscard]] std::filesystem::path write_quads(const std::string& name,
                                                const std::vector<Quad>& quads,
                                                bool double_sided = false);

/// Scenario around one static file: one material, no atmosphere, band 8-12 um, 21 June at 48.56 N.
/// Sim time 0 is 06:00 UTC. The surface has time constants of a millisecond, so that its
/// temperature is the equilibrium of the last interval.
[[nodiscard]] scene::ScenarioDesc instant_scenario(const std::filesystem::path& gltf);

/// Adds the entity 7, a box on wheels at the origin. It stands there until `leaves_ns` and is far
/// away a second later.
void park_vehicle(scene::ScenarioDesc& scenario, std::int64_t leaves_ns);

/// Constant weather from sim time 0.
[[nodiscard]] scene::WeatherSample weather(double direct_w_m2, double diffuse_w_m2,
                                           double longwave_w_m2, double environment_k);

/// World position of the surface that a pixel shows at a boresight distance.
[[nodiscard]] glm::dvec3 world_point(const scene::SensorDesc& sensor, const physics::Pose& pose,
                                     std::uint32_t x, std::uint32_t y, double depth_m);

}  // namespace emit::test
