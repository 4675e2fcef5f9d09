// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "surface/mesh/cluster_levels.hpp"
#include "surface/mesh/refined_mesh.hpp"

namespace emit::renderer {

/// Triangles of a refined mesh in the order in which a device gets them, and their levels of
/// detail. It is made once per surface, which takes seconds per million triangles, and saved.
struct DrawnMesh {
  /// Triangles of the finest level by submesh, then those of the coarser levels. Three indices of
  /// vertices each.
  std::vector<std::uint32_t> indices;
  ClusterLevels levels;
};

/// Returns `mesh` with the vertices and triangles of its refinement and with the backs of its
/// sheets. Setup only.
[[nodiscard]] scene::Mesh refined_copy(const scene::Mesh& mesh, const RefinedMesh& refined,
                                       std::span<const scene::Material> materials);

/// Cuts meshes into levels of detail by build_cluster_levels(). `values` holds the temperatures of
/// each mesh. The result depends on the input alone. Setup only: it uses all cores.
/// @pre values.size() == meshes.size()
[[nodiscard]] std::vector<DrawnMesh> drawn_meshes(std::vector<scene::Mesh> meshes,
                                                  std::span<const VertexValues> values);

}  // namespace emit::renderer
