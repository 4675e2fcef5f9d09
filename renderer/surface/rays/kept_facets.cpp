// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/kept_facets.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "emit/threads/parallel.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer {
namespace {

/// Smallest size of a triangle, as the side of an equilateral one of the same area. Finer ones
/// cannot be told apart in the image.
constexpr float kMinEdgePx = 1.2F;
/// Cosine between the normals of two corners below which the surface counts as bent. One degree
/// changes the temperature in the sun by some tenths of a kelvin.
constexpr float kEvenCos = 0.99985F;
/// Number of places along the path of the camera that are looked from.
constexpr std::size_t kEyes = 8;
/// Share of the way to a point that must be free.
constexpr float kSeenFrac = 0.999F;
constexpr std::size_t kGrain = 256;  ///< triangles of one unit of parallel work

/// Chooses some places of the camera, evenly along its path, in rel.
std::vector<glm::vec3> some_eyes(const scene::DetailView& view, const glm::dvec3& origin_world_m) {
  std::vector<glm::vec3> eyes_m;
  const std::size_t count = view.eyes_world_m.size();
  const std::size_t wanted = std::min(count, kEyes);
  for (std::size_t i = 0; i < wanted; ++i) {
    const std::size_t at = wanted > 1 ? i * (count - 1) / (wanted - 1) : 0;
    eyes_m.emplace_back(view.eyes_world_m[at] - origin_world_m);
  }
  return eyes_m;
}

/// Returns whether the normals of the corners differ.
bool bends(const scene::Mesh& mesh, const std::array<std::uint32_t, 3>& corner) noexcept {
  const auto cosine = [&](std::size_t a, std::size_t b) {
    return glm::dot(mesh.normals[corner[a]], mesh.normals[corner[b]]);
  };
  return std::min({cosine(0, 1), cosine(1, 2), cosine(2, 0)}) < kEvenCos;
}

/// Returns whether some eye sees the front of the triangle wider than a pixel.
bool seen_wide(const std::array<glm::vec3, 3>& corners_m, std::span<const glm::vec3> eyes_m,
               float pixel_rad, const CasterRays& rays) {
  const glm::vec3 across_m2 = glm::cross(corners_m[1] - corners_m[0], corners_m[2] - corners_m[0]);
  const glm::vec3 centre_m = (corners_m[0] + corners_m[1] + corners_m[2]) / 3.0F;
  const float edge_m = std::sqrt(glm::length(across_m2) * 2.0F / std::sqrt(3.0F));
  return std::ranges::any_of(eyes_m, [&](const glm::vec3& eye_m) {
    const glm::vec3 to_eye_m = eye_m - centre_m;
    const float distance_m = glm::length(to_eye_m);
    if (edge_m <= kMinEdgePx * pixel_rad * distance_m || !(glm::dot(across_m2, to_eye_m) > 0.0F)) {
      return false;
    }
    const CasterRay ray{eye_m, -to_eye_m / distance_m};
    std::array<CasterHit, 1> hit;
    return rays.first_hits({&ray, 1}, {true, {}}, hit) == 0U ||
           hit[0].distance_m > kSeenFrac * distance_m;
  });
}

/// Returns whether the sun reaches the centre of the triangle from any of the directions.
bool lit(const std::array<glm::vec3, 3>& corners_m, std::span<const glm::vec3> to_suns,
         const CasterRays& rays) {
  const glm::vec3 across_m2 = glm::cross(corners_m[1] - corners_m[0], corners_m[2] - corners_m[0]);
  const glm::vec3 centre_m = (corners_m[0] + corners_m[1] + corners_m[2]) / 3.0F;
  const float facet_m = std::max({glm::distance(corners_m[0], corners_m[1]),
                                  glm::distance(corners_m[1], corners_m[2]),
                                  glm::distance(corners_m[2], corners_m[0])});
  const glm::vec3 start_m =
      centre_m + ray_offsets(centre_m, facet_m).sun_m * glm::normalize(across_m2);
  return std::ranges::any_of(to_suns, [&](const glm::vec3& to_sun) {
    const CasterRay ray{start_m, to_sun};
    return glm::dot(across_m2, to_sun) > 0.0F && rays.blocked_static({&ray, 1}) == 0U;
  });
}

}  // namespace

std::vector<std::vector<bool>> kept_facets(const scene::SceneGeometry& geometry,
                                           std::span<const double> errors, const CasterRays& rays,
                                           const scene::DetailView& view,
                                           std::span<const glm::vec3> to_suns) {
  const std::vector<glm::vec3> eyes_m = some_eyes(view, rays.origin_world_m());
  const auto pixel_rad = static_cast<float>(view.pixel_rad);
  std::vector<std::vector<bool>> kept(geometry.meshes.size());
  std::vector<std::vector<std::uint8_t>> at_vertex(geometry.meshes.size());
  const auto corners = [](const scene::Mesh& mesh, std::size_t triangle) {
    const std::uint32_t* first = &mesh.indices[3 * triangle];
    return std::array{first[0], first[1], first[2]};
  };
  for (const scene::Instance& instance : geometry.instances) {
    if (errors[instance.mesh] == 0.0) continue;
    const scene::Mesh& mesh = geometry.meshes[instance.mesh];
    glm::dmat4 rel_from_mesh = instance.world_from_mesh;
    rel_from_mesh[3] -= glm::dvec4(rays.origin_world_m(), 0.0);
    const glm::mat4 to_rel(rel_from_mesh);
    const bool mirrored = glm::determinant(glm::dmat3(rel_from_mesh)) < 0.0;
    const std::size_t triangles = mesh.indices.size() / 3;
    std::vector<std::uint8_t> keep(triangles, 0);
    // Judge every triangle of the instance, the cheapest condition first.
    threads::parallel_parts(triangles, kGrain, [&](std::size_t from, std::size_t to) {
      for (std::size_t t = from; t < to; ++t) {
        const std::array<std::uint32_t, 3> corner = corners(mesh, t);
        if (!bends(mesh, corner)) continue;
        std::array<glm::vec3, 3> corners_m;
        for (std::size_t k = 0; k < 3; ++k) {
          corners_m[k] = glm::vec3(to_rel * glm::vec4(mesh.positions_m[corner[k]], 1.0F));
        }
        if (mirrored) std::swap(corners_m[1], corners_m[2]);
        const bool pays =
            seen_wide(corners_m, eyes_m, pixel_rad, rays) && lit(corners_m, to_suns, rays);
        if (pays) keep[t] = 1;
      }
    });
    // Mark the corners of the triangles to keep.
    for (std::size_t t = 0; t < triangles; ++t) {
      if (keep[t] == 0) continue;
      at_vertex[instance.mesh].resize(mesh.positions_m.size(), 0);
      for (const std::uint32_t v : corners(mesh, t)) at_vertex[instance.mesh][v] = 1;
    }
  }
  // Keep all triangles between marked vertices: a ragged border would prevent the simplification of
  // the rest.
  for (std::size_t m = 0; m < kept.size(); ++m) {
    if (at_vertex[m].empty()) continue;
    const scene::Mesh& mesh = geometry.meshes[m];
    for (std::size_t t = 0; t < mesh.indices.size() / 3; ++t) {
      kept[m].push_back(std::ranges::all_of(corners(mesh, t),
                                            [&](std::uint32_t v) { return at_vertex[m][v] != 0; }));
    }
  }
  return kept;
}

}  // namespace emit::renderer
