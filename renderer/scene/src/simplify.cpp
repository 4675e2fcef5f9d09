// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/simplify.hpp"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "emit/physics/check.hpp"

namespace emit::scene {
namespace {

/// Distance that a surface may move, in pixels.
constexpr double kErrorPx = 0.25;
/// Meshes whose triangles are wider than this on average are left alone: there is little to gain.
constexpr double kMinEdgePx = 6.0;
/// Instances that look wider than this have their own mesh, as long as the copies have no more than
/// kMaxCopied vertices. The meshes that classes share may have as many again.
constexpr double kOwnMeshPx = 16.0;
constexpr std::size_t kMaxCopied = 2'000'000;
/// Errors below this are smaller than the rounding of the collapse itself.
constexpr double kMinErrorM = 1e-6;

double greatest_scale(const glm::dmat4& m) {
  return std::max({glm::length(glm::dvec3(m[0])), glm::length(glm::dvec3(m[1])),
                   glm::length(glm::dvec3(m[2]))});
}

/// Pixels per metre on a surface in the box, seen from the nearest eye; infinite when an eye is
/// inside.
double pixels_per_m(const Aabb& box, const DetailView& view) {
  double nearest_m = std::numeric_limits<double>::infinity();
  for (const glm::dvec3& eye_m : view.eyes_world_m) {
    nearest_m = std::min(nearest_m, distance_m(box, eye_m));
  }
  return 1.0 / (view.pixel_rad * nearest_m);
}

/// Width of a pixel on the nearest instance of every mesh, in the mesh's own lengths; 0 for a mesh
/// that may come as close as it likes.
std::vector<double> pixel_widths(const SceneGeometry& geometry, const DetailView& view) {
  std::vector<double> widths(geometry.meshes.size(), std::numeric_limits<double>::infinity());
  for (const Instance& instance : geometry.instances) {
    double& width = widths[instance.mesh];
    if (instance.entity_id != 0 || view.eyes_world_m.empty()) {
      width = 0.0;
      continue;
    }
    if (instance.world_bounds.empty()) continue;
    const double scale = greatest_scale(instance.world_from_mesh);
    width = std::min(width, 1.0 / (pixels_per_m(instance.world_bounds, view) * scale));
  }
  return widths;
}

/// Width that a body shows at least from most sides. It is the thickness of a pole, but not that of
/// a sheet.
double middle_extent(const Aabb& box) {
  const glm::dvec3 e = box.max_m - box.min_m;
  return std::max(std::min(e.x, e.y), std::min(std::max(e.x, e.y), e.z));
}

/// Edge of an equilateral triangle that has the mean area of the mesh's triangles.
double mean_edge(const Mesh& mesh) {
  double area = 0.0;
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const glm::dvec3 a(mesh.positions_m[mesh.indices[i]]);
    const glm::dvec3 b(mesh.positions_m[mesh.indices[i + 1]]);
    const glm::dvec3 c(mesh.positions_m[mesh.indices[i + 2]]);
    area += 0.5 * glm::length(glm::cross(b - a, c - a));
  }
  const auto triangles = static_cast<double>(std::max<std::size_t>(1, mesh.indices.size() / 3));
  return std::sqrt(area / triangles * 4.0 / std::sqrt(3.0));
}

/// Renumbers the vertices; entries of `remap` that no triangle uses are ~0U.
void renumber(Mesh& mesh, std::span<const std::uint32_t> remap, std::size_t count) {
  const std::size_t vertices = mesh.positions_m.size();
  meshopt_remapIndexBuffer(mesh.indices.data(), mesh.indices.data(), mesh.indices.size(),
                           remap.data());
  const auto gather = [&](std::vector<glm::vec3>& values) {
    std::vector<glm::vec3> out(count);
    meshopt_remapVertexBuffer(out.data(), values.data(), vertices, sizeof(glm::vec3), remap.data());
    values = std::move(out);
  };
  gather(mesh.normals);
  gather(mesh.positions_m);
}

/// Collapses edges of a mesh. `kept` marks triangles that stay; empty: none.
void collapse(Mesh& mesh, double error, const std::vector<bool>& kept) {
  const float* positions = &mesh.positions_m[0].x;
  const std::size_t vertices = mesh.positions_m.size();
  const float scale = meshopt_simplifyScale(positions, vertices, sizeof(glm::vec3));
  // Neighbours of another material, and those that are kept, keep the border they share.
  unsigned int options = 0;
  if (mesh.submeshes.size() > 1 || !kept.empty()) options = meshopt_SimplifyLockBorder;
  std::vector<std::uint32_t> indices;
  std::vector<std::uint32_t> rest;
  std::vector<std::uint32_t> part;
  for (Submesh& submesh : mesh.submeshes) {
    const std::uint32_t first = submesh.first_index;
    submesh.first_index = static_cast<std::uint32_t>(indices.size());
    rest.clear();
    for (std::uint32_t i = first; i < first + submesh.index_count; i += 3) {
      std::vector<std::uint32_t>& to = !kept.empty() && kept[i / 3] ? indices : rest;
      for (std::uint32_t k = 0; k < 3; ++k) to.push_back(mesh.indices[i + k]);
    }
    part.resize(rest.size());
    const std::size_t count =
        meshopt_simplify(part.data(), rest.data(), rest.size(), positions, vertices,
                         sizeof(glm::vec3), 0, static_cast<float>(error) / scale, options, nullptr);
    indices.insert(indices.end(), part.begin(), part.begin() + static_cast<std::ptrdiff_t>(count));
    submesh.index_count = static_cast<std::uint32_t>(indices.size()) - submesh.first_index;
  }
  mesh.indices = std::move(indices);
  std::vector<std::uint32_t> remap(vertices);
  const std::size_t used = meshopt_optimizeVertexFetchRemap(remap.data(), mesh.indices.data(),
                                                            mesh.indices.size(), vertices);
  renumber(mesh, remap, used);
  mesh.bounds = {};
  for (const glm::vec3& p : mesh.positions_m) mesh.bounds.add(glm::dvec3(p));
}

}  // namespace

double distance_m(const Aabb& box, const glm::dvec3& point_m) noexcept {
  if (box.empty()) return 0.0;
  return glm::length(glm::max(glm::max(box.min_m - point_m, point_m - box.max_m), glm::dvec3(0.0)));
}

SceneGeometry separated(SceneGeometry geometry, const DetailView& view) {
  if (view.eyes_world_m.empty()) return geometry;
  std::vector<std::uint32_t> uses(geometry.meshes.size(), 0);
  std::vector<bool> taken(geometry.meshes.size(), false);  // the mesh as it is has its class
  for (const Instance& instance : geometry.instances) {
    ++uses[instance.mesh];
    if (instance.entity_id != 0) taken[instance.mesh] = true;
  }
  const auto copy_of = [&geometry](std::uint32_t mesh) {
    Mesh copy = geometry.meshes[mesh];
    geometry.meshes.push_back(std::move(copy));
    return static_cast<std::uint32_t>(geometry.meshes.size() - 1);
  };
  std::size_t copied = 0;
  std::size_t shared = 0;
  std::map<std::pair<std::uint32_t, int>, std::uint32_t> classes;
  for (Instance& instance : geometry.instances) {
    const std::uint32_t mesh = instance.mesh;
    if (instance.entity_id != 0 || instance.world_bounds.empty() || uses[mesh] < 2) continue;
    const double px_per_m = pixels_per_m(instance.world_bounds, view);
    const double width_m = glm::length(instance.world_bounds.max_m - instance.world_bounds.min_m);
    const std::size_t vertices = geometry.meshes[mesh].positions_m.size();
    if (width_m * px_per_m > kOwnMeshPx && copied + vertices <= kMaxCopied) {
      copied += vertices;
      --uses[mesh];
      instance.mesh = copy_of(mesh);
      continue;
    }
    const double scale = greatest_scale(instance.world_from_mesh);
    const int octave = std::ilogb(std::clamp(scale * px_per_m, 1e-9, 1e9));
    const auto [own, is_new] = classes.try_emplace({mesh, octave}, mesh);
    // Beyond the limit classes share: the mesh stays as fine as the nearest of them needs.
    if (is_new && taken[mesh] && shared + vertices <= kMaxCopied) {
      shared += vertices;
      own->second = copy_of(mesh);
    }
    taken[mesh] = true;
    instance.mesh = own->second;
  }
  return geometry;
}

std::vector<double> simplify_errors(const SceneGeometry& geometry, const DetailView& view,
                                    double most_body_frac) {
  const std::vector<double> widths = pixel_widths(geometry, view);
  std::vector<double> errors(widths.size(), 0.0);
  for (std::size_t m = 0; m < widths.size(); ++m) {
    const Mesh& mesh = geometry.meshes[m];
    const double error =
        std::min(kErrorPx * widths[m], most_body_frac * 0.5 * middle_extent(mesh.bounds));
    if (!(error > kMinErrorM) || !std::isfinite(error) || mesh.indices.empty()) continue;
    if (mean_edge(mesh) <= kMinEdgePx * widths[m]) errors[m] = error;
  }
  return errors;
}

SceneGeometry simplified(SceneGeometry geometry, std::span<const double> errors,
                         std::span<const std::vector<bool>> kept) {
  EMIT_CHECK_OP(errors.size(), ==, geometry.meshes.size());
  EMIT_CHECK(kept.empty() || kept.size() == geometry.meshes.size());
  for (std::size_t m = 0; m < geometry.meshes.size(); ++m) {
    if (errors[m] == 0.0) continue;
    collapse(geometry.meshes[m], errors[m], kept.empty() ? std::vector<bool>() : kept[m]);
  }
  geometry.triangles = 0;
  geometry.static_bounds = {};
  geometry.bounds = {};
  for (Instance& instance : geometry.instances) {
    const Mesh& mesh = geometry.meshes[instance.mesh];
    geometry.triangles += mesh.indices.size() / 3;
    instance.world_bounds = transformed(mesh.bounds, instance.world_from_mesh);
    geometry.bounds.add(instance.world_bounds);
    if (instance.entity_id == 0) geometry.static_bounds.add(instance.world_bounds);
  }
  return geometry;
}

}  // namespace emit::scene
