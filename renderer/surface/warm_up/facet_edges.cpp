// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/facet_edges.hpp"

#include <algorithm>

namespace emit::renderer {

void FacetEdges::grow(const RefinedMesh& mesh) {
  const auto vertices = mesh.vertices();
  const std::size_t first = longest_m_.size();
  longest_m_.resize(vertices.size(), 0.0F);
  if (first == 0) {
    for (std::uint32_t slot = 0; slot < mesh.leaf_count(); ++slot) {
      const auto& [a, b, c] = mesh.leaf(slot);
      const auto apart_m = [&](std::uint32_t from, std::uint32_t to) {
        return glm::distance(vertices[from].position_m, vertices[to].position_m);
      };
      const float most_m = std::max({apart_m(a, b), apart_m(b, c), apart_m(c, a)});
      for (const std::uint32_t v : {a, b, c}) longest_m_[v] = std::max(longest_m_[v], most_m);
    }
    return;
  }
  for (std::size_t v = first; v < vertices.size(); ++v) {
    const auto& [a, b] = vertices[v].parent;
    longest_m_[v] = std::max(longest_m_[a], longest_m_[b]);
  }
}

}  // namespace emit::renderer
