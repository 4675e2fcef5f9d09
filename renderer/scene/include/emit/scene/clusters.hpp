// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

namespace emit::scene {

/// Neighbouring triangles of one material that are drawn or left out together. Coordinates of the
/// mesh, metres.
struct Cluster {
  std::uint32_t first_index = 0;
  std::uint32_t index_count = 0;
  glm::vec3 centre_m{0.0F};  ///< of a sphere around all of them
  float radius_m = 0.0F;     ///< infinite: always drawn
  /// Of a box along the mesh's axes around all of them: ground that is seen at a flat angle reaches
  /// far less into a view pyramid than its sphere does. Infinite where the radius is.
  glm::vec3 box_centre_m{0.0F};
  glm::vec3 box_half_m{0.0F};
  /// All turn their backs to a point p where
  /// dot(normalize(cone_apex_m - p), cone_axis) >= cone_cutoff; never where cone_cutoff is 1.
  glm::vec3 cone_apex_m{0.0F};
  glm::vec3 cone_axis{0.0F};
  float cone_cutoff = 1.0F;
};

/// Triangles that make a cluster at most.
inline constexpr std::size_t kClusterTriangles = 256;

/// Reorders triangles so that those of a cluster follow each other and a device transforms a vertex
/// about once. Clusters in the order of their indices, which they cover; first_index counts from
/// the first of them. Setup only: about a second per million triangles, and time for every vertex.
[[nodiscard]] std::vector<Cluster> cut_into_clusters(std::span<const glm::vec3> positions_m,
                                                     std::span<std::uint32_t> indices);

/// By vertex: the same number for all that lie in the same place, below the number of vertices; ~0
/// for those that no triangle uses. Setup only.
[[nodiscard]] std::vector<std::uint32_t> place_numbers(std::span<const glm::vec3> positions_m,
                                                       std::span<const std::uint32_t> indices);

/// Indices of points along a space-filling curve: neighbours in the list lie near each other.
/// Setup only.
[[nodiscard]] std::vector<std::uint32_t> curve_order(std::span<const glm::vec3> points_m);

}  // namespace emit::scene
