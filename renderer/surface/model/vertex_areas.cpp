// SPDX-License-Identifier: Apache-2.0
#include "surface/model/vertex_areas.hpp"

#include <array>
#include <glm/geometric.hpp>

namespace emit::renderer {

std::vector<float> vertex_areas_m2(const RefinedMesh& mesh, const scene::Instance& instance) {
  std::vector<float> area_m2(mesh.vertices().size());
  for (std::uint32_t slot = 0; slot < mesh.leaf_count(); ++slot) {
    std::array<glm::dvec3, 3> corner_m;
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::vec3& at_m = mesh.vertices()[mesh.leaf(slot)[k]].position_m;
      corner_m[k] = glm::dvec3(instance.body_from_mesh * glm::dvec4(glm::dvec3(at_m), 1.0));
    }
    const double twice_m2 =
        glm::length(glm::cross(corner_m[1] - corner_m[0], corner_m[2] - corner_m[0]));
    for (const std::uint32_t v : mesh.leaf(slot)) area_m2[v] += static_cast<float>(twice_m2 / 6.0);
  }
  return area_m2;
}

}  // namespace emit::renderer
