// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/rain.hpp"

#include <algorithm>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_double4.hpp>
#include <glm/geometric.hpp>

#include "emit/physics/climate/surface_water.hpp"

namespace emit::scene {
namespace {

/// Returns true if the material says what rain does to it.
bool states_rain(const Material& material, const ThermalOptions& thermal) noexcept {
  if (material.prescribed_k) return true;
  if (thermal.model == ThermalModel::emit2014) return false;
  const physics::MoistSurface water = moisture_of(material);
  const bool open_water = water.wetness_frac >= 1.0 && !(water.resistance_s_m > 0.0);
  return open_water || !water_store_of(material).none();
}

/// Returns true if a triangle of the submesh looks up.
bool looks_up(const Mesh& mesh, const Submesh& submesh, const Instance& instance) {
  const auto corner = [&](std::size_t index) {
    return glm::dvec3(instance.world_from_mesh *
                      glm::dvec4(glm::dvec3(mesh.positions_m[mesh.indices[index]]), 1.0));
  };
  for (std::size_t i = 0; i + 2 < submesh.index_count; i += 3) {
    const std::size_t first = submesh.first_index + i;
    const glm::dvec3 a = corner(first);
    const glm::dvec3 normal = glm::cross(corner(first + 1) - a, corner(first + 2) - a);
    const double up = submesh.double_sided ? std::abs(normal.z) : normal.z;
    if (up > physics::kRainTiltCosine * glm::length(normal)) return true;
  }
  return false;
}

}  // namespace

std::vector<std::uint32_t> materials_without_rain(const ThermalOptions& thermal,
                                                  const SceneGeometry& geometry) {
  std::vector<std::uint32_t> found;
  for (const Instance& instance : geometry.instances) {
    const Mesh& mesh = geometry.meshes[instance.mesh];
    for (const Submesh& submesh : mesh.submeshes) {
      if (std::ranges::count(found, submesh.material) > 0 ||
          states_rain(geometry.materials[submesh.material], thermal) ||
          !looks_up(mesh, submesh, instance)) {
        continue;
      }
      found.push_back(submesh.material);
    }
  }
  std::ranges::sort(found);
  return found;
}

}  // namespace emit::scene
