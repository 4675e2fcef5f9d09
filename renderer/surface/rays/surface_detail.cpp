// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/surface_detail.hpp"

#include <array>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <utility>

namespace emit::renderer {
namespace {

/// Smallest cosine between the normals of the full and the coarse surface (60 degrees).
constexpr float kMinCos = 0.5F;

}  // namespace

SurfaceDetail::SurfaceDetail(scene::SceneGeometry full, CasterRays rays,
                             const scene::SceneGeometry& coarse)
    : full_(std::move(full)),
      rays_(std::move(rays)),
      instance_of_mesh_(coarse.meshes.size(), kNone) {
  EMIT_CHECK_OP(full_.meshes.size(), ==, coarse.meshes.size());
  EMIT_CHECK_OP(full_.instances.size(), ==, coarse.instances.size());
  // Choose one static instance of every mesh that has lost triangles: rays find the surface of the
  // mesh there.
  for (std::size_t i = 0; i < full_.instances.size(); ++i) {
    const std::uint32_t mesh = full_.instances[i].mesh;
    if (full_.instances[i].entity_id == 0 && instance_of_mesh_[mesh] == kNone &&
        coarse.meshes[mesh].indices.size() < full_.meshes[mesh].indices.size()) {
      instance_of_mesh_[mesh] = static_cast<std::uint32_t>(i);
    }
  }
  for (std::size_t mesh = 0; mesh < full_.meshes.size(); ++mesh) {
    if (instance_of_mesh_[mesh] == kNone) full_.meshes[mesh] = {};  // the rays have their own copy
  }
}

std::optional<SurfaceDetail::Place> SurfaceDetail::place(std::uint32_t mesh,
                                                         const glm::vec3& position_m,
                                                         const glm::vec3& normal,
                                                         float reach_m) const noexcept {
  EMIT_DCHECK(has(mesh));
  const std::uint32_t index = instance_of_mesh_[mesh];
  const glm::dmat4& world_from_mesh = full_.instances[index].world_from_mesh;
  // Send a ray against the normal, from `reach_m` outside the surface to `reach_m` inside.
  const glm::dvec3 to_world = glm::dmat3(world_from_mesh) * glm::dvec3(normal);
  const double scale = glm::length(to_world);
  const glm::vec3 direction(-to_world / scale);
  const float reach_rel_m = reach_m * static_cast<float>(scale);
  const glm::vec3 at_m(glm::dvec3(world_from_mesh * glm::dvec4(glm::dvec3(position_m), 1.0)) -
                       rays_.origin_world_m());
  const CasterRay ray{at_m - reach_rel_m * direction, direction};
  std::array<CasterHit, 1> hit;
  if (rays_.first_hits({&ray, 1}, {true, {}}, hit) == 0U || hit[0].instance != index ||
      hit[0].distance_m > 2.0F * reach_rel_m) {
    return std::nullopt;
  }
  // Interpolate the normal of the full mesh at the hit.
  const scene::Mesh& full = full_.meshes[mesh];
  const std::size_t first = std::size_t{3} * hit[0].triangle;
  const auto corner = [&](std::size_t k) { return full.normals[full.indices[first + k]]; };
  const glm::vec2 b = hit[0].barycentric;
  const glm::vec3 sum = (1.0F - b.x - b.y) * corner(0) + b.x * corner(1) + b.y * corner(2);
  const float length = glm::length(sum);
  if (!(length > 0.0F) || glm::dot(sum, normal) < kMinCos * length) return std::nullopt;
  // Move the point along the normal by the distance to the hit, in lengths of the mesh.
  const auto to_full = static_cast<float>((reach_rel_m - hit[0].distance_m) / scale);
  return Place{position_m + to_full * normal, sum / length};
}

}  // namespace emit::renderer
