// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <vector>

#include "surface/mesh/refined_mesh.hpp"

namespace emit::renderer {

/// Longest edge of the original triangles around each vertex of a mesh, in the axes of the mesh.
/// Rays are traced against these triangles, and float32 resolves less around long ones. A vertex
/// that halves an edge takes the greater value of its parents.
class FacetEdges {
 public:
  /// Adds the vertices that the mesh has more than at the last call.
  /// @pre nothing is halved yet at the first call
  void grow(const RefinedMesh& mesh);
  [[nodiscard]] float longest_m(std::size_t vertex) const { return longest_m_[vertex]; }

 private:
  std::vector<float> longest_m_;  ///< by vertex
};

}  // namespace emit::renderer
