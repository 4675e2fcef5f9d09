// SPDX-License-Identifier: Apache-2.0
#include "surface/model/entity_exitance.hpp"

#include <algorithm>
#include <cmath>

#include "surface/model/vertex_areas.hpp"
#include "surface/rays/hot_parts.hpp"

namespace emit::renderer {
namespace {

/// Smallest cosine between a face and an axis with which the face counts. A flatter one is hardly
/// seen from there.
constexpr float kMinCos = 0.3F;

/// Index into EntityFaces of a direction along an axis.
std::size_t face_of(glm::length_t axis, bool positive) noexcept {
  return 2 * static_cast<std::size_t>(axis) + (positive ? 0U : 1U);
}

}  // namespace

EntityExitance::EntityExitance(const SurfaceModel& model, const scene::SceneGeometry& geometry,
                               std::span<const std::int32_t> entity_of_object) {
  for (std::size_t p = 0; p < geometry.instances.size(); ++p) {
    const scene::Instance& instance = geometry.instances[p];
    if (entity_of_object[instance.object] < 0) continue;
    const RefinedMesh& mesh = model.meshes[instance.mesh];
    const std::vector<float> area_m2 = vertex_areas_m2(mesh, instance);
    // List the samples that others can see. A sheet sends from both of its sides.
    const std::uint32_t first = model.first_sample[p];
    for (std::uint32_t v = 0; v < area_m2.size(); ++v) {
      // Leave out samples that another face covers: they lie inside the body.
      const SurfaceSample& sample = model.samples.samples[first + v];
      if (sample.covered || !(area_m2[v] > 0.0F)) continue;
      if (HotParts::hot(geometry.materials[sample.material])) continue;
      parts_.push_back({first + v, area_m2[v]});
      if (sample.other_side != kNoSample) parts_.push_back({sample.other_side, area_m2[v]});
    }
  }
}

void EntityExitance::add(const glm::vec3& normal, float area_m2, float sent_w_m2,
                         EntityFaces& faces) noexcept {
  for (glm::length_t axis = 0; axis < 3; ++axis) {
    const float cosine = std::abs(normal[axis]);
    if (cosine < kMinCos) continue;
    const std::size_t face = face_of(axis, normal[axis] > 0.0F);
    faces.area_m2[face] += cosine * area_m2;
    faces.sent_w[face] += cosine * area_m2 * sent_w_m2;
  }
}

float EntityFaces::towards_w_m2(const glm::vec3& normal) const noexcept {
  float weight = 0.0F;
  float sum_w_m2 = 0.0F;
  for (glm::length_t axis = 0; axis < 3; ++axis) {
    // Take the faces of the entity that look the other way: those are the ones that this surface
    // sees.
    const std::size_t face = face_of(axis, normal[axis] < 0.0F);
    if (!(area_m2[face] > 0.0F)) continue;
    const float share = normal[axis] * normal[axis];
    weight += share;
    sum_w_m2 += share * sent_w[face] / area_m2[face];
  }
  return weight > 0.0F ? sum_w_m2 / weight : -1.0F;
}

}  // namespace emit::renderer
