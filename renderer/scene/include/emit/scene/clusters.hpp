// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

namespace emit::scene {

/// Neighbouring triangles of one material that are drawn or left out together. Lengths are those of
/// the mesh.
struct Cluster {
  std::uint32_t first_index = 0;
  std::uint32_t index_count = 0;
  glm::vec3 centre_m{0.0F};  ///< centre of a sphere around all triangles
  float radius_m = 0.0F;     ///< radius of that sphere; infinite: the cluster is always drawn
  /// Centre and half size of a box along the mesh's axes around all triangles. Ground that is seen
  /// at a flat angle reaches far less into a view pyramid than its sphere does. The box is infinite
  /// when the radius is.
  glm::vec3 box_centre_m{0.0F};
  glm::vec3 box_half_m{0.0F};
  /// All triangles turn their backs to a point p with
  /// dot(normalize(cone_apex_m - p), cone_axis) >= cone_cutoff. No point does so when cone_cutoff
  /// is 1.
  glm::vec3 cone_apex_m{0.0F};
  glm::vec3 cone_axis{0.0F};
  float cone_cutoff = 1.0F;
};

/// Largest number of triangles in a cluster.
inline constexpr std::size_t kClusterTriangles = 256;

/// Reorders triangles so that those of a cluster follow each other and a device transforms a vertex
/// about once. Returns the clusters in the order of their indices, all of which they cover;
/// first_index counts from the first index given. Setup only: about a second per million triangles,
/// and time for every vertex.
/// @pre every index is below the number of positions.
[[nodiscard]] std::vector<Cluster> cut_into_clusters(std::span<const glm::vec3> positions_m,
                                                     std::span<std::uint32_t> indices);

/// Gives all vertices in the same place the same number, which is below the number of vertices.
/// Vertices that no triangle uses get ~0. Setup only.
/// @pre every index is below the number of positions.
[[nodiscard]] std::vector<std::uint32_t> place_numbers(std::span<const glm::vec3> positions_m,
                                                       std::span<const std::uint32_t> indices);

/// Orders points along a space-filling curve, so that neighbours in the list lie near each other.
/// Returns indices of the points.
/// Setup only.
[[nodiscard]] std::vector<std::uint32_t> curve_order(std::span<const glm::vec3> points_m);

}  // namespace emit::scene
