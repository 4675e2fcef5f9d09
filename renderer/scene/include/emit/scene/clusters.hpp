// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <vector>

#include "emit/scene/mesh.hpp"

namespace emit::scene {

/// Neighbouring triangles of one submesh that are drawn or left out together. Coordinates of the
/// mesh, metres.
struct Cluster {
  std::uint32_t first_index = 0;
  std::uint32_t index_count = 0;
  glm::vec3 centre_m{0.0F};  ///< of a sphere around all of them
  float radius_m = 0.0F;     ///< infinite: always drawn
  /// All turn their backs to a point p where
  /// dot(normalize(cone_apex_m - p), cone_axis) >= cone_cutoff; never where cone_cutoff is 1.
  glm::vec3 cone_apex_m{0.0F};
  glm::vec3 cone_axis{0.0F};
  float cone_cutoff = 1.0F;
};

/// Triangles that make a cluster at most.
inline constexpr std::size_t kClusterTriangles = 256;

/// Reorders the triangles of every submesh so that those of a cluster follow each other and a
/// device transforms a vertex about once. Vertices keep their places. Clusters in the order of
/// their indices; those of a submesh cover its range. Setup only: about a second per million
/// triangles.
[[nodiscard]] std::vector<Cluster> cut_into_clusters(Mesh& mesh);

}  // namespace emit::scene
