// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::reference {

/// Triangle of a scene in world axes, with the axis and direction of its normal.
struct VoxelTriangle {
  std::array<glm::dvec3, 3> p_m;
  std::size_t axis = 0;
  int sign = 1;
  std::uint32_t material = 0;
  std::uint32_t object = 0;
  bool ground = false;
  double sheet_m = 0.0;  ///< thickness of a sheet, 0 for the face of a solid
};

/// Returns an axis as an index of a vector.
[[nodiscard]] inline glm::dvec3::length_type vector_index(std::size_t axis) {
  return static_cast<glm::dvec3::length_type>(axis);
}

/// Returns the error for a scene that is not handled, naming the object.
[[nodiscard]] tl::unexpected<physics::Error> refuse_shape(const scene::ScenarioDesc& scenario,
                                                          std::uint32_t object, std::string text);

/// Returns the triangles of a scene, without those that have no area. Errors: unsupported (moving
/// objects, oblique faces, an emitter of given temperature, no triangle).
[[nodiscard]] physics::Result<std::vector<VoxelTriangle>> voxel_triangles(
    const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry);

}  // namespace emit::reference
