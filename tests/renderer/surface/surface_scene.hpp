// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/matrix_transform.hpp>
#include <glm/ext/vector_float3.hpp>
#include <glm/geometric.hpp>
#include <initializer_list>
#include <utility>

#include "emit/scene/mesh.hpp"

namespace emit::renderer::test {

/// Adds a quad, counter-clockwise seen from its outside, as two triangles from its first corner.
inline void add_quad(scene::Mesh& mesh, const std::array<glm::vec3, 4>& corners) {
  const auto base = static_cast<std::uint32_t>(mesh.positions_m.size());
  const glm::vec3 normal =
      glm::normalize(glm::cross(corners[1] - corners[0], corners[2] - corners[0]));
  for (const glm::vec3& corner : corners) {
    mesh.positions_m.push_back(corner);
    mesh.normals.push_back(normal);
    mesh.bounds.add(glm::dvec3(corner));
  }
  for (const std::uint32_t index : {0U, 1U, 2U, 0U, 2U, 3U}) mesh.indices.push_back(base + index);
  mesh.submeshes = {{0, static_cast<std::uint32_t>(mesh.indices.size()), 0, false}};
}

/// Level rectangle at height `z_m` that looks up.
inline scene::Mesh level_mesh(const glm::vec3& low, const glm::vec3& high, float z_m) {
  scene::Mesh mesh;
  add_quad(mesh, {glm::vec3(low.x, low.y, z_m), glm::vec3(high.x, low.y, z_m),
                  glm::vec3(high.x, high.y, z_m), glm::vec3(low.x, high.y, z_m)});
  return mesh;
}

/// Level, upwards-looking grid of cells x cells squares over [0, 1]^2.
inline scene::Mesh grid_mesh(int cells) {
  scene::Mesh mesh;
  const float step_m = 1.0F / static_cast<float>(cells);
  for (int y = 0; y < cells; ++y) {
    for (int x = 0; x < cells; ++x) {
      const glm::vec3 low(static_cast<float>(x) * step_m, static_cast<float>(y) * step_m, 0.0F);
      add_quad(mesh, {low, low + glm::vec3(step_m, 0.0F, 0.0F),
                      low + glm::vec3(step_m, step_m, 0.0F), low + glm::vec3(0.0F, step_m, 0.0F)});
    }
  }
  return mesh;
}

/// Closed box, faces outwards, in the order -x, +x, -y, +y, -z, +z of two triangles each.
inline scene::Mesh box_mesh(const glm::vec3& low, const glm::vec3& high) {
  scene::Mesh mesh;
  const auto at = [&](int x, int y, int z) {
    return glm::vec3(x != 0 ? high.x : low.x, y != 0 ? high.y : low.y, z != 0 ? high.z : low.z);
  };
  add_quad(mesh, {at(0, 0, 0), at(0, 0, 1), at(0, 1, 1), at(0, 1, 0)});
  add_quad(mesh, {at(1, 0, 0), at(1, 1, 0), at(1, 1, 1), at(1, 0, 1)});
  add_quad(mesh, {at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1)});
  add_quad(mesh, {at(0, 1, 0), at(0, 1, 1), at(1, 1, 1), at(1, 1, 0)});
  add_quad(mesh, {at(0, 0, 0), at(0, 1, 0), at(1, 1, 0), at(1, 0, 0)});
  add_quad(mesh, {at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1)});
  mesh.closed = true;
  return mesh;
}

/// A scene put together by hand; every call of add_* makes an object of its own.
struct SurfaceScene {
  scene::SceneGeometry geometry;
  std::uint32_t objects = 0;

  std::uint32_t add_mesh(scene::Mesh mesh) {
    geometry.meshes.push_back(std::move(mesh));
    return static_cast<std::uint32_t>(geometry.meshes.size() - 1);
  }
  std::uint32_t add_static(std::uint32_t mesh, const glm::dmat4& world_from_mesh) {
    scene::Instance instance;
    instance.mesh = mesh;
    instance.object = objects++;
    instance.world_from_mesh = world_from_mesh;
    geometry.instances.push_back(instance);
    return static_cast<std::uint32_t>(geometry.instances.size() - 1);
  }
  std::uint32_t add_static(scene::Mesh mesh, const glm::dvec3& position_m = glm::dvec3(0.0)) {
    return add_static(add_mesh(std::move(mesh)), glm::translate(glm::dmat4(1.0), position_m));
  }
  std::uint32_t add_entity(scene::Mesh mesh, const glm::dmat4& body_from_mesh = glm::dmat4(1.0)) {
    scene::Instance instance;
    instance.mesh = add_mesh(std::move(mesh));
    instance.entity_id = 100 + objects;
    instance.object = objects++;
    instance.body_from_mesh = body_from_mesh;
    instance.world_from_mesh = body_from_mesh;
    geometry.instances.push_back(instance);
    return static_cast<std::uint32_t>(geometry.instances.size() - 1);
  }
};

}  // namespace emit::renderer::test
