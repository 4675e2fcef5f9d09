// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/held_faces.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "emit/physics/constants.hpp"

namespace emit::renderer {
namespace {

/// Points of a face that shadow rays go to.
constexpr std::size_t kPoints = CasterRays::kMaxRays;
/// Share of the way to a point in which something must stand to hide it.
constexpr float kBeforeFrac = 0.999F;

/// Evenly spread weights of a triangle's second and third corner (Roberts' sequence, folded).
std::array<glm::vec2, kPoints> spread_points() {
  std::array<glm::vec2, kPoints> out;
  for (std::size_t i = 0; i < kPoints; ++i) {
    const double u = std::fmod(0.5 + 0.7548776662466927 * static_cast<double>(i + 1), 1.0);
    const double v = std::fmod(0.5 + 0.5698402909980532 * static_cast<double>(i + 1), 1.0);
    out[i] = u + v > 1.0 ? glm::vec2(1.0 - u, 1.0 - v) : glm::vec2(u, v);
  }
  return out;
}

}  // namespace

double form_factor(const std::array<glm::dvec3, 3>& corners_m, const glm::dvec3& normal) noexcept {
  // Cut the triangle at the tangent plane. One plane adds at most one corner.
  std::array<glm::dvec3, 4> polygon;
  std::size_t count = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const glm::dvec3& a = corners_m[i];
    const glm::dvec3& b = corners_m[(i + 1) % 3];
    const double above_a = glm::dot(a, normal);
    const double above_b = glm::dot(b, normal);
    if (above_a >= 0.0) polygon[count++] = a;
    if ((above_a < 0.0) != (above_b < 0.0)) {
      polygon[count++] = a + (above_a / (above_a - above_b)) * (b - a);
    }
  }
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const glm::dvec3& a = polygon[i];
    const glm::dvec3& b = polygon[(i + 1) % count];
    const glm::dvec3 across = glm::cross(a, b);
    const double length = glm::length(across);
    if (!(length > 0.0)) continue;
    sum += std::atan2(length, glm::dot(a, b)) * glm::dot(normal, across) / length;
  }
  return sum / (2.0 * physics::kPi);
}

HeldFaces::HeldFaces(const scene::SceneGeometry& geometry,
                     std::span<const scene::Material> materials,
                     std::span<const std::int32_t> entity_of_object,
                     const glm::dvec3& origin_world_m) {
  for (std::uint32_t i = 0; i < geometry.instances.size(); ++i) {
    const scene::Instance& instance = geometry.instances[i];
    const scene::Mesh& mesh = geometry.meshes[instance.mesh];
    const std::int32_t entity = entity_of_object[instance.object];
    glm::dmat4 to_rel = instance.body_from_mesh;
    if (entity < 0) {
      to_rel = instance.world_from_mesh;
      to_rel[3] -= glm::dvec4(origin_world_m, 0.0);
    }
    const bool mirrored = glm::determinant(glm::dmat3(to_rel)) < 0.0;
    for (const scene::Submesh& submesh : mesh.submeshes) {
      const scene::Material& material = materials[submesh.material];
      if (!material.prescribed_k) continue;
      for (std::uint32_t k = 0; k + 2 < submesh.index_count; k += 3) {
        if (faces_.size() == kMost) {
          faces_.clear();
          return;
        }
        const std::uint32_t first = submesh.first_index + k;
        Face face{.instance = i,
                  .triangle = first / 3,
                  .entity = entity,
                  .corners_m = {},
                  .two_sided = material.sheet};
        for (std::size_t c = 0; c < 3; ++c) {
          face.corners_m[c] = glm::vec3(
              to_rel * glm::dvec4(glm::dvec3(mesh.positions_m[mesh.indices[first + c]]), 1.0));
        }
        if (mirrored) std::swap(face.corners_m[1], face.corners_m[2]);
        faces_.push_back(face);
      }
    }
  }
}

void HeldFaces::seen_from(const CasterRays& casters, const ViewPoint& point,
                          const CasterSelection& selection, std::vector<Part>& parts) const {
  static const std::array<glm::vec2, kPoints> kSpread = spread_points();
  parts.clear();
  const glm::vec3 start_m = point.position_m + point.offset_m * (point.normal + point.inward);
  for (const Face& face : faces_) {
    std::array<glm::vec3, 3> at_m = face.corners_m;
    if (face.entity >= 0) {
      const auto entity = static_cast<std::size_t>(face.entity);
      if (entity >= selection.entities.size() || !selection.entities[entity].on) continue;
      const EntityPlacement& place = selection.entities[entity];
      for (glm::vec3& corner : at_m) corner = place.rel_from_body * corner + place.position_m;
    } else if (!selection.fixed) {
      continue;
    }
    // A face is seen from outside, unless it is a sheet.
    std::array<glm::dvec3, 3> from_point_m;
    for (std::size_t c = 0; c < 3; ++c) from_point_m[c] = glm::dvec3(at_m[c] - start_m);
    const glm::vec3 outward = glm::cross(at_m[1] - at_m[0], at_m[2] - at_m[0]);
    const bool behind = glm::dot(outward, start_m - at_m[0]) < 0.0F;
    if (behind && !face.two_sided) continue;
    // Seen from outside the corners turn counter-clockwise, and their edges' planes inwards.
    const double frac = std::abs(form_factor(from_point_m, glm::dvec3(point.normal)));
    if (!(frac > 0.0)) continue;
    // Weigh the points with what they send.
    std::array<CasterRay, kPoints> rays;
    std::array<CasterHit, kPoints> hits;
    std::array<float, kPoints> way_m{};
    std::array<float, kPoints> sent{};
    float farthest_m = 0.0F;
    for (std::size_t k = 0; k < kPoints; ++k) {
      const glm::vec2& w = kSpread[k];
      const glm::vec3 way =
          at_m[0] + w.x * (at_m[1] - at_m[0]) + w.y * (at_m[2] - at_m[0]) - start_m;
      way_m[k] = glm::length(way);
      rays[k] = {start_m, way / way_m[k]};
      sent[k] = std::max(0.0F, glm::dot(rays[k].direction, point.normal)) *
                std::abs(glm::dot(rays[k].direction, outward)) / (way_m[k] * way_m[k]);
      farthest_m = std::max(farthest_m, way_m[k]);
    }
    const std::uint32_t met = casters.first_hits(rays, selection, hits, farthest_m);
    float all = 0.0F;
    float visible = 0.0F;
    for (std::size_t k = 0; k < kPoints; ++k) {
      const bool hidden = ((met >> k) & 1U) != 0U && hits[k].distance_m < kBeforeFrac * way_m[k] &&
                          !(hits[k].instance == face.instance && hits[k].triangle == face.triangle);
      all += sent[k];
      if (!hidden) visible += sent[k];
    }
    if (!(visible > 0.0F)) continue;
    parts.push_back({face.instance, face.triangle,
                     static_cast<float>(frac) * (all > 0.0F ? visible / all : 1.0F), behind});
  }
}

}  // namespace emit::renderer
