// SPDX-License-Identifier: Apache-2.0
// Construction of a RefinedMesh from parts that may come from a file. The parts are checked,
// because a file may be damaged.
#include <algorithm>
#include <utility>

#include "surface/mesh/refined_mesh.hpp"

namespace emit::renderer {
namespace {

constexpr std::uint32_t kTagBits = 3;  ///< mask of the tag of a node
constexpr std::uint32_t kLeafTag = 3;  ///< tag of a leaf

/// Checks that the vertices begin with those of the mesh and that parents come before their
/// children.
bool vertices_fit(const scene::Mesh& mesh, const RefinedMesh::Parts& parts) {
  const std::size_t count = parts.vertices.size();
  if (count < mesh.positions_m.size()) return false;
  for (std::uint32_t v = 0; v < count; ++v) {
    for (const std::uint32_t parent : parts.vertices[v].parent) {
      if (parent > v) return false;
    }
  }
  for (std::size_t v = 0; v < mesh.positions_m.size(); ++v) {
    if (parts.vertices[v].position_m != mesh.positions_m[v]) return false;
  }
  return true;
}

/// Checks that the lists of leaves have equal lengths and that their vertices and submeshes exist.
bool leaves_fit(const scene::Mesh& mesh, const RefinedMesh::Parts& parts) {
  const std::size_t count = parts.leaves.size();
  if (count < mesh.indices.size() / 3 || parts.leaf_submesh.size() != count ||
      parts.leaf_node.size() != count) {
    return false;
  }
  return std::ranges::all_of(
             parts.leaves,
             [&](const auto& leaf) { return std::ranges::max(leaf) < parts.vertices.size(); }) &&
         std::ranges::all_of(parts.leaf_submesh,
                             [&](std::uint32_t s) { return s < mesh.submeshes.size(); });
}

/// Checks that every node except the roots is the child of exactly one node before it, and that
/// every leaf has its own node.
bool nodes_fit(const scene::Mesh& mesh, const RefinedMesh::Parts& parts) {
  const std::size_t roots = mesh.indices.size() / 3;
  if (parts.nodes.size() < roots) return false;
  std::vector<bool> has_parent(parts.nodes.size(), false);
  std::size_t leaves = 0;
  for (std::uint32_t n = 0; n < parts.nodes.size(); ++n) {
    const std::uint32_t entry = parts.nodes[n];
    const std::uint32_t at = entry >> 2U;
    if (n >= roots && !has_parent[n]) return false;
    if ((entry & kTagBits) == kLeafTag) {
      ++leaves;
      if (at >= parts.leaves.size() || parts.leaf_node[at] != n) return false;
    } else {
      if (at <= n || at < roots || std::size_t{at} + 1 >= parts.nodes.size() || has_parent[at] ||
          has_parent[at + 1]) {
        return false;
      }
      has_parent[at] = has_parent[at + 1] = true;
    }
  }
  return leaves == parts.leaves.size();
}

}  // namespace

std::optional<RefinedMesh> RefinedMesh::from(const scene::Mesh& mesh, std::size_t max_vertices,
                                             Parts parts) {
  if (!vertices_fit(mesh, parts) || !leaves_fit(mesh, parts) || !nodes_fit(mesh, parts)) {
    return std::nullopt;
  }
  RefinedMesh out(mesh, max_vertices);
  out.vertices_ = std::move(parts.vertices);
  out.leaves_ = std::move(parts.leaves);
  out.leaf_submesh_ = std::move(parts.leaf_submesh);
  out.leaf_node_ = std::move(parts.leaf_node);
  out.nodes_ = std::move(parts.nodes);
  return out;
}

}  // namespace emit::renderer
