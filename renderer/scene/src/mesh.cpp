// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/mesh.hpp"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/ext/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>

namespace emit::scene {

void Aabb::add(const glm::dvec3& point_m) noexcept {
  min_m = glm::min(min_m, point_m);
  max_m = glm::max(max_m, point_m);
}

void Aabb::add(const Aabb& other) noexcept {
  if (!other.empty()) {
    add(other.min_m);
    add(other.max_m);
  }
}

Aabb transformed(const Aabb& box, const glm::dmat4& target_from_source) noexcept {
  Aabb result;
  if (box.empty()) {
    return result;
  }
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 point((corner & 1) != 0 ? box.max_m.x : box.min_m.x,
                           (corner & 2) != 0 ? box.max_m.y : box.min_m.y,
                           (corner & 4) != 0 ? box.max_m.z : box.min_m.z);
    result.add(glm::dvec3(target_from_source * glm::dvec4(point, 1.0)));
  }
  return result;
}

void update_bounds(Mesh& mesh) {
  mesh.bounds = {};
  for (const std::uint32_t index : mesh.indices) {
    mesh.bounds.add(glm::dvec3(mesh.positions_m[index]));
  }
  mesh.closed = is_closed_surface(mesh);
}

glm::dmat4 body_from_gltf() noexcept {
  // Columns: where glTF x (left), y (up) and z (forward) go in forward, right, down.
  return glm::dmat4(glm::dvec4(0.0, -1.0, 0.0, 0.0), glm::dvec4(0.0, 0.0, -1.0, 0.0),
                    glm::dvec4(1.0, 0.0, 0.0, 0.0), glm::dvec4(0.0, 0.0, 0.0, 1.0));
}

glm::dmat4 body_from_model(const ObjectDesc& object) noexcept {
  const glm::dvec3& angles = object.model_rotation_rad;
  glm::dmat4 matrix = glm::translate(glm::dmat4(1.0), object.model_offset_m);
  // An angle of zero is left out, so that an object without rotation keeps its exact matrix.
  if (angles.x != 0.0) matrix = glm::rotate(matrix, angles.x, glm::dvec3(0.0, 0.0, 1.0));
  if (angles.y != 0.0) matrix = glm::rotate(matrix, angles.y, glm::dvec3(0.0, 1.0, 0.0));
  if (angles.z != 0.0) matrix = glm::rotate(matrix, angles.z, glm::dvec3(1.0, 0.0, 0.0));
  return glm::scale(matrix, glm::dvec3(object.scale));
}

physics::AirFilmBody film_body(const ScenarioDesc& scenario, const SceneGeometry& geometry,
                               std::size_t object) {
  constexpr double kShortestM = 0.01;
  physics::AirFilmBody body = scenario.objects[object].air_film;
  if (body.length_m > 0.0) return body;
  Aabb box;
  for (const Instance& instance : geometry.instances) {
    if (instance.object != object) continue;
    for (const glm::vec3& p_mesh_m : geometry.meshes[instance.mesh].positions_m) {
      box.add(glm::dvec3(instance.body_from_mesh * glm::dvec4(p_mesh_m, 1.0)));
    }
  }
  const glm::dvec3 size_m = box.empty() ? glm::dvec3(0.0) : box.max_m - box.min_m;
  body.length_m = std::max({size_m.x, size_m.y, size_m.z, kShortestM});
  return body;
}

glm::dmat4 world_from_body_matrix(const physics::Pose& pose) noexcept {
  return glm::translate(glm::dmat4(1.0), pose.position_world_m) *
         glm::mat4_cast(glm::normalize(pose.world_from_body));
}

}  // namespace emit::scene
