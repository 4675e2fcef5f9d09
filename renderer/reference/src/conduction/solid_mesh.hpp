// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <glm/ext/vector_double3.hpp>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/reference/solid_solver.hpp"

namespace emit::reference {

/// A grid turned into a network: heat capacities at the nodes and conductances between them. Free
/// nodes come first, numbered along z, then x, then y, so that a line into the depth of the ground
/// is contiguous in memory. Nodes of fixed temperature follow.
struct SolidMesh {
  std::size_t free_count = 0;
  std::vector<glm::dvec3> nodes_m;   ///< all nodes
  std::vector<double> capacity_j_k;  ///< free nodes
  std::vector<double> fixed_k;       ///< nodes after the free ones
  /// Neighbours of free node i: columns[row_start[i] .. row_start[i + 1]), ascending. Entries
  /// before upper_start[i] are smaller than i.
  std::vector<std::uint32_t> row_start;
  std::vector<std::uint32_t> upper_start;
  std::vector<std::uint32_t> columns;
  std::vector<double> conductance_w_k;      ///< positive, one value per entry of columns
  std::vector<double> conductance_sum_w_k;  ///< sum over the whole row, free nodes

  std::vector<SolidFace> faces;  ///< exposed faces
  /// Free nodes that touch exposed faces, and the list of those faces: surface node s has
  /// node_faces[face_start[s] .. face_start[s + 1]).
  std::vector<std::uint32_t> surface_nodes;
  std::vector<std::uint32_t> face_start;
  std::vector<std::uint32_t> node_faces;
  std::vector<double> emission_w_k4;  ///< sum of eps sigma A / 4 per surface node
  bool plane = false;                 ///< true if the grid is one cell deep along some axis
};

/// Builds the network. Errors: invalid_argument (grid or boundary conditions out of range).
[[nodiscard]] physics::Result<SolidMesh> build_solid_mesh(
    const SolidGrid& grid, const std::function<FaceCondition(const SolidFace&)>& condition);

}  // namespace emit::reference
