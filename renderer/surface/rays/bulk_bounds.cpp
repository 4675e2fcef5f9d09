// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/bulk_bounds.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <vector>

namespace emit::renderer {
namespace {

/// Largest radius, in m, at which float32 still resolves less than the distance at which rays
/// start.
constexpr double kResolvedM = 500.0;
/// Ratio of the box of all to the box without strays from which on strays are ignored.
constexpr double kStrayWidths = 16.0;
/// Width of the cube around the box without strays in whose reach triangles are kept, in widths of
/// that box.
constexpr double kKeptWidths = 4.0;
/// Share of the triangles that may be strays at either end of an axis.
constexpr double kStrayFrac = 0.01;
/// Number of triangles, evenly spread over all, that are looked at. At most twice as many are.
constexpr std::size_t kMaxLooked = 100'000;

/// Returns half the diagonal of a box, 0 for an empty one.
double half_diagonal_m(const scene::Aabb& box) {
  return box.empty() ? 0.0 : 0.5 * glm::length(box.max_m - box.min_m);
}

/// Returns the box of the triangles that reach into `around`: where that leaves out strays alone,
/// it is the box of the scene without them, to the bit.
scene::Aabb box_inside(std::span<const CasterPart> parts, const scene::Aabb& around) {
  scene::Aabb all;
  for (const CasterPart& part : parts) {
    const scene::Mesh& mesh = *part.mesh;
    scene::Aabb box;
    for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
      std::array<glm::dvec3, 3> corner_m;
      bool known = true;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t vertex = mesh.indices[i + k];
        known = known && vertex < mesh.positions_m.size();
        if (known) corner_m[k] = glm::dvec3(mesh.positions_m[vertex]);
        known = known && std::isfinite(corner_m[k].x + corner_m[k].y + corner_m[k].z);
      }
      if (!known) continue;
      scene::Aabb own;
      for (const glm::dvec3& at_m : corner_m) {
        own.add(glm::dvec3(part.frame_from_mesh * glm::dvec4(at_m, 1.0)));
      }
      // The comparison fails for what is not finite.
      if (!glm::all(glm::lessThanEqual(around.min_m, own.max_m)) ||
          !glm::all(glm::lessThanEqual(own.min_m, around.max_m))) {
        continue;
      }
      for (const glm::dvec3& at_m : corner_m) box.add(at_m);
    }
    if (!box.empty()) all.add(scene::transformed(box, part.frame_from_mesh));
  }
  return all;
}

}  // namespace

scene::Aabb bulk_bounds(std::span<const CasterPart> parts) {
  const scene::Aabb all = bounds_of(parts);
  if (half_diagonal_m(all) <= kResolvedM) return all;

  // Collect the centres of some triangles, axis by axis.
  std::size_t triangles = 0;
  for (const CasterPart& part : parts) triangles += part.mesh->indices.size() / 3;
  const std::size_t stride = std::max<std::size_t>(1, triangles / kMaxLooked);
  std::array<std::vector<double>, 3> centres_m;
  std::size_t next = 0;
  std::size_t first = 0;
  for (const CasterPart& part : parts) {
    const scene::Mesh& mesh = *part.mesh;
    const std::size_t count = mesh.indices.size() / 3;
    for (; next < first + count; next += stride) {
      glm::dvec3 sum_m(0.0);
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t vertex = mesh.indices[3 * (next - first) + k];
        if (vertex < mesh.positions_m.size()) sum_m += glm::dvec3(mesh.positions_m[vertex]);
      }
      const glm::dvec3 centre_m(part.frame_from_mesh * glm::dvec4(sum_m / 3.0, 1.0));
      if (!std::isfinite(centre_m.x + centre_m.y + centre_m.z)) continue;
      for (glm::length_t axis = 0; axis < 3; ++axis) {
        centres_m[static_cast<std::size_t>(axis)].push_back(centre_m[axis]);
      }
    }
    first += count;
  }
  if (centres_m[0].empty()) return all;

  // Cut the same share off both ends of every axis.
  const std::size_t strays = std::max<std::size_t>(
      1, static_cast<std::size_t>(kStrayFrac * static_cast<double>(centres_m[0].size())));
  if (centres_m[0].size() <= 2 * strays) return all;
  glm::dvec3 low_m;
  glm::dvec3 high_m;
  for (glm::length_t axis = 0; axis < 3; ++axis) {
    std::vector<double>& along_m = centres_m[static_cast<std::size_t>(axis)];
    const auto low = along_m.begin() + static_cast<std::ptrdiff_t>(strays);
    std::ranges::nth_element(along_m, low);
    low_m[axis] = *low;
    const auto high = along_m.end() - 1 - static_cast<std::ptrdiff_t>(strays);
    std::ranges::nth_element(along_m, high);
    high_m[axis] = *high;
  }
  // Double the box, so that the wide ends of what is not stray are inside.
  scene::Aabb bulk;
  const glm::dvec3 half_m = 0.5 * (high_m - low_m);
  bulk.add(low_m - half_m);
  bulk.add(high_m + half_m);
  if (!(half_diagonal_m(all) > kStrayWidths * half_diagonal_m(bulk))) return all;
  // Take what the scene is without its strays, so that these move nothing. They are farther off
  // than a few widths.
  const glm::dvec3 middle_m = 0.5 * (bulk.min_m + bulk.max_m);
  const glm::dvec3 wide_m = bulk.max_m - bulk.min_m;
  const double reach_m = 0.5 * kKeptWidths * std::max({wide_m.x, wide_m.y, wide_m.z});
  scene::Aabb around;
  around.add(middle_m - reach_m);
  around.add(middle_m + reach_m);
  const scene::Aabb kept = box_inside(parts, around);
  return kept.empty() || half_diagonal_m(kept) > kStrayWidths * half_diagonal_m(bulk) ? bulk : kept;
}

scene::Aabb bulk_bounds(const scene::SceneGeometry& geometry) {
  const bool any_static = std::ranges::any_of(
      geometry.instances, [](const scene::Instance& instance) { return instance.entity_id == 0; });
  std::vector<CasterPart> parts;
  for (std::size_t i = 0; i < geometry.instances.size(); ++i) {
    const scene::Instance& instance = geometry.instances[i];
    if (any_static && instance.entity_id != 0) continue;
    parts.push_back(
        {static_cast<std::uint32_t>(i), &geometry.meshes[instance.mesh], instance.world_from_mesh});
  }
  return bulk_bounds(parts);
}

}  // namespace emit::renderer
