// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <glm/ext/vector_double3.hpp>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/reference/solid_solver.hpp"

namespace emit::reference {

/// The grid turned into a network: heat capacities at nodes, conductances between them. Free nodes
/// come first, numbered along z, then x, then y, so that a line into the depth of the ground is
/// contiguous; nodes of fixed temperature follow.
struct SolidMesh {
  std::size_t free_count = 0;
  std::vector<glm::dvec3> nodes_m;   ///< all
  std::vector<double> capacity_j_k;  ///< free
  std::vector<double> fixed_k;       ///< of the nodes after the free ones
  /// Neighbours of free node i: columns_[row_start[i] .. row_start[i + 1]), ascending; below
  /// upper_start[i] they are smaller than i.
  std::vector<std::uint32_t> row_start;
  std::vector<std::uint32_t> upper_start;
  std::vector<std::uint32_t> columns;
  std::vector<double> conductance_w_k;      ///< positive, as long as columns
  std::vector<double> conductance_sum_w_k;  ///< free: over the whole row

  std::vector<SolidFace> faces;  ///< exposed
  /// Free nodes that touch exposed faces, and those faces: node_faces[face_start[s] ...).
  std::vector<std::uint32_t> surface_nodes;
  std::vector<std::uint32_t> face_start;
  std::vector<std::uint32_t> node_faces;
  std::vector<double> emission_w_k4;  ///< per surface node: sum of eps sigma A / 4
  bool plane = false;                 ///< one cell deep along some axis
};

[[nodiscard]] physics::Result<SolidMesh> build_solid_mesh(
    const SolidGrid& grid, const std::function<FaceCondition(const SolidFace&)>& condition);

}  // namespace emit::reference
