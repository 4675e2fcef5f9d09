// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/clusters.hpp"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <limits>

#include "emit/physics/check.hpp"

namespace emit::scene {
namespace {

/// Largest number of vertices in a cluster. A cluster whose vertices are all different reaches it
/// before it is full of triangles.
constexpr std::size_t kClusterVertices = 192;
/// Weight of facing alike against lying close, 0 to 1, when a cluster grows.
constexpr float kConeWeight = 0.5F;

glm::vec3 vec3(const float (&v)[3]) {
  return {v[0], v[1], v[2]};
}

bool is_finite(const Cluster& cluster) {
  const float sum = cluster.centre_m.x + cluster.centre_m.y + cluster.centre_m.z +
                    cluster.radius_m + cluster.cone_apex_m.x + cluster.cone_apex_m.y +
                    cluster.cone_apex_m.z + cluster.cone_axis.x + cluster.cone_axis.y +
                    cluster.cone_axis.z + cluster.cone_cutoff + cluster.box_centre_m.x +
                    cluster.box_centre_m.y + cluster.box_centre_m.z + cluster.box_half_m.x +
                    cluster.box_half_m.y + cluster.box_half_m.z;
  return std::isfinite(sum);
}

/// True when every index is below the number of vertices.
bool within(std::span<const std::uint32_t> indices, std::size_t vertices) {
  return std::ranges::all_of(indices, [=](std::uint32_t index) { return index < vertices; });
}

void set_box(Cluster& cluster, std::span<const glm::vec3> positions_m,
             std::span<const std::uint32_t> indices) {
  glm::vec3 least_m(std::numeric_limits<float>::infinity());
  glm::vec3 most_m = -least_m;
  for (const std::uint32_t v : indices) {
    least_m = glm::min(least_m, positions_m[v]);
    most_m = glm::max(most_m, positions_m[v]);
  }
  cluster.box_centre_m = 0.5F * (least_m + most_m);
  cluster.box_half_m = 0.5F * (most_m - least_m);
}

/// Cuts triangles in their order into clusters that are always drawn. The library leaves triangles
/// out when its arithmetic overflows, at the extremes of float32.
void cut_in_order(std::uint32_t indices, std::vector<Cluster>& clusters) {
  constexpr auto kIndices = static_cast<std::uint32_t>(3 * kClusterTriangles);
  for (std::uint32_t at = 0; at < indices; at += kIndices) {
    Cluster cluster;
    cluster.first_index = at;
    cluster.index_count = std::min(indices - at, kIndices);
    cluster.radius_m = std::numeric_limits<float>::infinity();
    cluster.box_half_m = glm::vec3(std::numeric_limits<float>::infinity());
    clusters.push_back(cluster);
  }
}

}  // namespace

std::vector<Cluster> cut_into_clusters(std::span<const glm::vec3> positions_m,
                                       std::span<std::uint32_t> indices) {
  std::vector<Cluster> clusters;
  if (indices.empty()) return clusters;
  EMIT_DCHECK(within(indices, positions_m.size()));
  const float* positions = &positions_m[0].x;
  const std::size_t vertices = positions_m.size();
  meshopt_optimizeVertexCache(indices.data(), indices.data(), indices.size(), vertices);
  const std::size_t most =
      meshopt_buildMeshletsBound(indices.size(), kClusterVertices, kClusterTriangles);
  std::vector<meshopt_Meshlet> meshlets(most);
  std::vector<unsigned int> own_vertices(most * kClusterVertices);
  std::vector<unsigned char> corners(most * kClusterTriangles * 3);
  meshlets.resize(meshopt_buildMeshlets(
      meshlets.data(), own_vertices.data(), corners.data(), indices.data(), indices.size(),
      positions, vertices, sizeof(glm::vec3), kClusterVertices, kClusterTriangles, kConeWeight));
  std::vector<std::uint32_t> ordered;
  ordered.reserve(indices.size());
  std::vector<std::uint32_t> part;
  bool finite = true;
  for (const meshopt_Meshlet& meshlet : meshlets) {
    const unsigned int* own = own_vertices.data() + meshlet.vertex_offset;
    const unsigned char* corner = corners.data() + meshlet.triangle_offset;
    part.assign(corner, corner + std::size_t{meshlet.triangle_count} * 3);
    meshopt_optimizeVertexCache(part.data(), part.data(), part.size(), meshlet.vertex_count);
    for (std::uint32_t& index : part) index = own[index];
    const meshopt_Bounds bounds = meshopt_computeClusterBounds(part.data(), part.size(), positions,
                                                               vertices, sizeof(glm::vec3));
    Cluster cluster;
    cluster.first_index = static_cast<std::uint32_t>(ordered.size());
    cluster.index_count = static_cast<std::uint32_t>(part.size());
    cluster.centre_m = vec3(bounds.center);
    cluster.radius_m = bounds.radius;
    cluster.cone_apex_m = vec3(bounds.cone_apex);
    cluster.cone_axis = vec3(bounds.cone_axis);
    cluster.cone_cutoff = bounds.cone_cutoff;
    set_box(cluster, positions_m, part);
    finite = finite && is_finite(cluster);
    clusters.push_back(cluster);
    ordered.insert(ordered.end(), part.begin(), part.end());
  }
  if (!finite || ordered.size() != indices.size()) {
    clusters.clear();
    cut_in_order(static_cast<std::uint32_t>(indices.size()), clusters);
    return clusters;
  }
  std::memcpy(indices.data(), ordered.data(), indices.size_bytes());
  return clusters;
}

std::vector<std::uint32_t> place_numbers(std::span<const glm::vec3> positions_m,
                                         std::span<const std::uint32_t> indices) {
  EMIT_DCHECK(within(indices, positions_m.size()));
  std::vector<std::uint32_t> numbers(positions_m.size());
  const meshopt_Stream stream{positions_m.data(), sizeof(glm::vec3), sizeof(glm::vec3)};
  meshopt_generateVertexRemapMulti(numbers.data(), indices.data(), indices.size(), numbers.size(),
                                   &stream, 1);
  return numbers;
}

std::vector<std::uint32_t> curve_order(std::span<const glm::vec3> points_m) {
  std::vector<std::uint32_t> order(points_m.size());
  if (points_m.empty()) return order;
  std::vector<std::uint32_t> place(points_m.size());
  meshopt_spatialSortRemap(place.data(), &points_m[0].x, points_m.size(), sizeof(glm::vec3));
  for (std::uint32_t i = 0; i < place.size(); ++i) order[place[i]] = i;
  return order;
}

}  // namespace emit::scene
