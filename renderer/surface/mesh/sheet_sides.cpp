// SPDX-License-Identifier: Apache-2.0
#include "surface/mesh/sheet_sides.hpp"

#include <algorithm>
#include <array>

namespace emit::renderer {

std::vector<std::uint32_t> back_vertices(const RefinedMesh& mesh,
                                         std::span<const scene::Material> materials) {
  std::vector<std::uint32_t> out;
  const auto vertices = mesh.vertices();
  for (std::uint32_t v = 0; v < vertices.size(); ++v) {
    if (materials[vertices[v].material].sheet) out.push_back(v);
  }
  return out;
}

void add_backs(const RefinedMesh& refined, std::span<const scene::Material> materials,
               scene::Mesh& mesh) {
  const std::vector<std::uint32_t> backs = back_vertices(refined, materials);
  if (backs.empty()) return;
  // Add a vertex with the opposite normal for each vertex of a sheet.
  const auto first = static_cast<std::uint32_t>(mesh.positions_m.size());
  for (const std::uint32_t v : backs) {
    mesh.positions_m.push_back(mesh.positions_m[v]);
    mesh.normals.push_back(-mesh.normals[v]);
  }
  const auto back_of = [&](std::uint32_t v) {
    return first + static_cast<std::uint32_t>(std::ranges::lower_bound(backs, v) - backs.begin());
  };
  // Add a submesh with opposite winding for each submesh of a sheet.
  const std::size_t fronts = mesh.submeshes.size();
  for (std::size_t k = 0; k < fronts; ++k) {
    if (!materials[mesh.submeshes[k].material].sheet) continue;
    mesh.submeshes[k].double_sided = false;
    scene::Submesh back = mesh.submeshes[k];
    back.first_index = static_cast<std::uint32_t>(mesh.indices.size());
    for (std::uint32_t i = 0; i < back.index_count; i += 3) {
      const std::uint32_t* corner = &mesh.indices[mesh.submeshes[k].first_index + i];
      const std::array<std::uint32_t, 3> turned{back_of(corner[0]), back_of(corner[2]),
                                                back_of(corner[1])};
      mesh.indices.insert(mesh.indices.end(), turned.begin(), turned.end());
    }
    mesh.submeshes.push_back(back);
  }
}

}  // namespace emit::renderer
