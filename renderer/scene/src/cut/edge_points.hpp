// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

namespace emit::scene {

/// Vertex that a cut has put on an edge of a triangle.
struct EdgePoint {
  std::uint32_t vertex = 0;
  std::uint32_t first = 0;  ///< ends of the edge
  std::uint32_t second = 0;
  double second_share = 0.0;  ///< of the second end; the first has the rest
};

/// A surface whose triangles have been cut, as one of several of a mesh.
struct EdgeSurface {
  std::vector<glm::dvec3>& positions;
  std::vector<glm::vec3>& normals;  ///< empty, or one for each position
  std::vector<EdgePoint>& edge_points;
  std::vector<std::vector<std::uint32_t>*> triangles;  ///< lists of three indices a triangle
};

/// Gives both triangles at an edge the same vertices on it, wherever one of them was cut. Without
/// that, images that lie differently on both sides would leave a mesh with open edges, through
/// which rays pass and along which no heat flows. Edges are the same where the positions of their
/// ends are equal.
void share_edge_points(std::span<const EdgeSurface> surfaces);

}  // namespace emit::scene
