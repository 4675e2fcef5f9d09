// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <utility>

#include "emit/physics/constants.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

/// Scenes of boxes and rectangles for tests of the reference solution.
namespace emit::reference {

/// Adds a rectangle a, b, c, d, counter-clockwise seen from outside.
inline void add_quad(scene::Mesh& mesh, const std::array<glm::dvec3, 4>& corners) {
  const auto first = static_cast<std::uint32_t>(mesh.positions_m.size());
  const glm::dvec3 normal =
      glm::normalize(glm::cross(corners[1] - corners[0], corners[2] - corners[0]));
  for (const glm::dvec3& p : corners) {
    mesh.positions_m.emplace_back(p);
    mesh.normals.emplace_back(normal);
  }
  for (const std::uint32_t i : {0U, 1U, 2U, 0U, 2U, 3U}) mesh.indices.push_back(first + i);
}

inline void add_box(scene::Mesh& mesh, const glm::dvec3& a, const glm::dvec3& b) {
  add_quad(mesh, {{{a.x, a.y, a.z}, {a.x, b.y, a.z}, {b.x, b.y, a.z}, {b.x, a.y, a.z}}});
  add_quad(mesh, {{{a.x, a.y, b.z}, {b.x, a.y, b.z}, {b.x, b.y, b.z}, {a.x, b.y, b.z}}});
  add_quad(mesh, {{{a.x, a.y, a.z}, {b.x, a.y, a.z}, {b.x, a.y, b.z}, {a.x, a.y, b.z}}});
  add_quad(mesh, {{{b.x, b.y, a.z}, {a.x, b.y, a.z}, {a.x, b.y, b.z}, {b.x, b.y, b.z}}});
  add_quad(mesh, {{{a.x, b.y, a.z}, {a.x, a.y, a.z}, {a.x, a.y, b.z}, {a.x, b.y, b.z}}});
  add_quad(mesh, {{{b.x, a.y, a.z}, {b.x, b.y, a.z}, {b.x, b.y, b.z}, {b.x, a.y, b.z}}});
}

/// Radiation of a black face, W/m2.
inline double black_w_m2(double kelvin) {
  return physics::kStefanBoltzmannWPerM2K4 * std::pow(kelvin, 4.0);
}

struct TestScene {
  scene::ScenarioDesc scenario;
  scene::SceneGeometry geometry;
};

inline void finish_mesh(TestScene& t, scene::Mesh mesh, std::uint32_t material) {
  mesh.submeshes = {{0, static_cast<std::uint32_t>(mesh.indices.size()), material, false}};
  for (const glm::vec3& p : mesh.positions_m) mesh.bounds.add(glm::dvec3(p));
  scene::Instance instance;
  instance.mesh = static_cast<std::uint32_t>(t.geometry.meshes.size());
  instance.world_bounds = mesh.bounds;
  t.geometry.meshes.push_back(std::move(mesh));
  t.geometry.instances.push_back(instance);
}

}  // namespace emit::reference
