// SPDX-License-Identifier: Apache-2.0
#include "surface/mesh/drawn_mesh.hpp"

#include <cstddef>
#include <utility>

#include "emit/physics/check.hpp"
#include "emit/threads/parallel.hpp"
#include "surface/mesh/sheet_sides.hpp"

namespace emit::renderer {

scene::Mesh refined_copy(const scene::Mesh& mesh, const RefinedMesh& refined,
                         std::span<const scene::Material> materials) {
  scene::Mesh out = mesh;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> ranges;
  refined.write_indices(out.indices, ranges);
  for (std::size_t k = 0; k < out.submeshes.size(); ++k) {
    out.submeshes[k].first_index = ranges[k].first;
    out.submeshes[k].index_count = ranges[k].second;
  }
  out.positions_m.clear();
  out.normals.clear();
  for (const RefinedMesh::Vertex& vertex : refined.vertices()) {
    out.positions_m.push_back(vertex.position_m);
    out.normals.push_back(vertex.normal);
  }
  add_backs(refined, materials, out);
  return out;
}

std::vector<DrawnMesh> drawn_meshes(std::vector<scene::Mesh> meshes,
                                    std::span<const VertexValues> values) {
  EMIT_CHECK_OP(values.size(), ==, meshes.size());
  std::vector<DrawnMesh> drawn(meshes.size());
  threads::parallel_parts(meshes.size(), 1, [&](std::size_t first, std::size_t last) {
    for (std::size_t m = first; m < last; ++m) {
      drawn[m].levels = build_cluster_levels(meshes[m], values[m]);
      drawn[m].indices = std::move(meshes[m].indices);
    }
  });
  return drawn;
}

}  // namespace emit::renderer
