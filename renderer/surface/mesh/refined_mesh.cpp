// SPDX-License-Identifier: Apache-2.0
#include "surface/mesh/refined_mesh.hpp"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include "surface/mesh/refined_mesh_edges.hpp"

namespace emit::renderer {
namespace {

/// Mark of a vertex that no triangle has used yet.
constexpr std::uint32_t kUnused = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint32_t kLeafTag = 3;  ///< low two bits of a node that is a leaf
constexpr float kMinEdge = 1e-6F;      ///< shortest edge to halve, in the mesh's unit of length
/// Shortest edge to halve, as a share of the largest coordinate: 32 to 64 float32 steps.
constexpr float kMinEdgeFrac = 0x1p-18F;
constexpr std::size_t kMaxNodes = std::size_t{1} << 30U;  ///< an entry has 30 bits beside its tag

/// Returns the edge of the kept child from the midpoint to the apex, after a cut along `half_edge`.
std::uint32_t inner_half_edge(std::uint32_t half_edge) noexcept {
  return half_edge - half_edge % 3 + (half_edge + 1) % 3;
}

std::uint32_t leaf_entry(std::uint32_t slot) noexcept {
  return slot << 2U | kLeafTag;
}

/// Returns the mean of two unit normals. Equal ones stay as they are, bit for bit, so that planes
/// stay flat. The first one counts if they are opposite.
glm::vec3 mean_normal(const glm::vec3& a, const glm::vec3& b) noexcept {
  const glm::vec3 sum = a + b;
  const float length = glm::length(sum);
  return a == b || length < 1e-3F ? a : sum / length;
}

/// Returns whether an edge is too short to be halved. Below this length the rounding of a midpoint
/// shows in the shape of the halves, and edges without a clear order of length would be halved
/// without end.
bool too_short(const glm::vec3& a_m, const glm::vec3& b_m) noexcept {
  const glm::vec3 reach_m = glm::max(glm::abs(a_m), glm::abs(b_m));
  const float largest_m = std::max({reach_m.x, reach_m.y, reach_m.z});
  return glm::distance(a_m, b_m) < std::max(kMinEdge, kMinEdgeFrac * largest_m);
}

}  // namespace

RefinedMesh::RefinedMesh(const scene::Mesh& mesh, std::size_t max_vertices)
    : max_vertices_(max_vertices), submeshes_(mesh.submeshes) {
  vertices_.resize(mesh.positions_m.size());
  for (std::uint32_t v = 0; v < vertices_.size(); ++v) {
    vertices_[v].position_m = mesh.positions_m[v];
    vertices_[v].normal = mesh.normals[v];
    vertices_[v].parent = {v, v};
  }
  // Give each material and kind its own copy of a vertex. The copies form a chain whose last link
  // points at itself.
  std::vector<std::uint32_t> next_copy(vertices_.size(), kUnused);
  const auto of_kind = [&](std::uint32_t vertex, const scene::Submesh& kind) {
    if (next_copy[vertex] == kUnused) {
      next_copy[vertex] = vertex;
      vertices_[vertex].material = kind.material;
      vertices_[vertex].sheet = kind.double_sided;
      return vertex;
    }
    for (std::uint32_t copy = vertex;; copy = next_copy[copy]) {
      if (vertices_[copy].material == kind.material && vertices_[copy].sheet == kind.double_sided) {
        return copy;
      }
      if (next_copy[copy] != copy) continue;
      const auto added = static_cast<std::uint32_t>(vertices_.size());
      Vertex fresh = vertices_[vertex];
      fresh.material = kind.material;
      fresh.sheet = kind.double_sided;
      fresh.parent = {added, added};
      vertices_.push_back(fresh);
      next_copy.push_back(added);
      next_copy[copy] = added;
      return added;
    }
  };

  // Make every triangle of the mesh a leaf and the root of a tree.
  const std::size_t triangles = mesh.indices.size() / 3;
  leaves_.resize(triangles);
  leaf_submesh_.resize(triangles);
  leaf_node_.resize(triangles);
  nodes_.resize(triangles);
  for (std::uint32_t s = 0; s < submeshes_.size(); ++s) {
    const std::uint32_t first = submeshes_[s].first_index / 3;
    for (std::uint32_t t = first; t < first + submeshes_[s].index_count / 3; ++t) {
      for (std::uint32_t k = 0; k < 3; ++k) {
        leaves_[t][k] = of_kind(mesh.indices[std::size_t{3} * t + k], submeshes_[s]);
      }
      leaf_submesh_[t] = s;
      leaf_node_[t] = t;
      nodes_[t] = leaf_entry(t);
    }
  }
}

/// Returns the half-edge of the leaf's longest edge. The indices of the positions decide between
/// equal lengths: all leaves then agree on one order of all edges, and a path to ever longer ones
/// must end.
std::uint32_t RefinedMesh::longest_edge(std::uint32_t slot) const noexcept {
  const std::array<std::uint32_t, 3>& corner = leaves_[slot];
  std::uint32_t best = 0;
  double best_m2 = -1.0;
  std::pair<std::uint32_t, std::uint32_t> best_ends;
  for (std::uint32_t k = 0; k < 3; ++k) {
    const std::uint32_t a = corner[k];
    const std::uint32_t b = corner[(k + 1) % 3];
    const glm::dvec3 edge_m =
        glm::dvec3(vertices_[b].position_m) - glm::dvec3(vertices_[a].position_m);
    const double length_m2 = glm::dot(edge_m, edge_m);
    const std::pair<std::uint32_t, std::uint32_t> ends =
        std::minmax({position_id_[a], position_id_[b]});
    if (length_m2 > best_m2 || (length_m2 == best_m2 && ends > best_ends)) {
      best = k;
      best_m2 = length_m2;
      best_ends = ends;
    }
  }
  return 3 * slot + best;
}

/// Returns whether two corners of a leaf are at one position.
bool RefinedMesh::has_double_corner(std::uint32_t slot) const noexcept {
  const std::uint32_t a = position_id_[leaves_[slot][0]];
  const std::uint32_t b = position_id_[leaves_[slot][1]];
  const std::uint32_t c = position_id_[leaves_[slot][2]];
  return a == b || b == c || c == a;
}

bool RefinedMesh::split(std::span<const std::uint32_t> slots) {
  if (ring_.empty()) {
    position_id_ = weld_positions(vertices_);
    ring_ = link_edges(leaves_, position_id_);
  }
  // Note the nodes now. A leaf that is halved as a neighbour of an earlier one leaves its node and
  // must not be halved again.
  asked_nodes_.clear();
  for (const std::uint32_t slot : slots) asked_nodes_.push_back(leaf_node_[slot]);
  bool complete = true;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    if (leaf_node_[slots[i]] != asked_nodes_[i] || has_double_corner(slots[i])) continue;
    if (split_leaf(slots[i]) == Outcome::full) complete = false;
  }
  return complete;
}

/// Follows longer and longer edges to one that is the longest of all its leaves and halves it, then
/// goes back until the longest edge of the leaf itself is such an edge.
RefinedMesh::Outcome RefinedMesh::split_leaf(std::uint32_t slot) {
  path_.assign(1, slot);
  while (!path_.empty()) {
    const std::uint32_t edge = longest_edge(path_[path_.size() - 1]);
    // Look for a leaf on this edge that has a longer edge of its own: it comes first.
    std::uint32_t other = ring_[edge];
    while (other != edge && longest_edge(other / 3) == other) other = ring_[other];
    if (other != edge) {
      path_.push_back(other / 3);
      continue;
    }
    const Outcome outcome = halve_edge(edge);
    if (outcome != Outcome::halved) return outcome;
    path_.pop_back();
  }
  return Outcome::halved;
}

/// Halves an edge in all its leaves; it must be the longest edge of each. Nothing changes unless it
/// returns `halved`.
RefinedMesh::Outcome RefinedMesh::halve_edge(std::uint32_t half_edge) {
  cuts_.clear();
  midpoints_.clear();
  // Collect the leaves on the edge and the midpoints that they need.
  for (std::uint32_t h = half_edge;;) {
    cuts_.push_back({h, midpoint_of(h)});
    h = ring_[h];
    if (h == half_edge) break;
  }
  const glm::vec3 low_m = vertices_[midpoints_[0].low].position_m;
  const glm::vec3 high_m = vertices_[midpoints_[0].high].position_m;
  if (too_short(low_m, high_m)) return Outcome::too_short;
  if (vertices_.size() + midpoints_.size() > max_vertices_ ||
      nodes_.size() + 2 * cuts_.size() > kMaxNodes) {
    return Outcome::full;
  }

  // Add one vertex per side of a crease or seam, all at one position.
  const glm::vec3 middle_m = 0.5F * low_m + 0.5F * high_m;
  const auto first_vertex = static_cast<std::uint32_t>(vertices_.size());
  const std::uint32_t end_position = position_id_[midpoints_[0].low];
  for (const Midpoint& midpoint : midpoints_) {
    const Vertex& low = vertices_[midpoint.low];
    vertices_.push_back({middle_m,
                         mean_normal(low.normal, vertices_[midpoint.high].normal),
                         low.material,
                         low.sheet,
                         {midpoint.low, midpoint.high}});
    position_id_.push_back(first_vertex);
  }
  for (Cut& each : cuts_) cut(each, first_vertex + each.midpoint);
  link_cuts(end_position);
  return Outcome::halved;
}

/// Returns the index into `midpoints_` of the midpoint between the vertices of this half-edge. It
/// is added if it is not there yet.
std::uint32_t RefinedMesh::midpoint_of(std::uint32_t half_edge) {
  const std::array<std::uint32_t, 3>& corner = leaves_[half_edge / 3];
  const auto [low, high] = std::minmax({corner[half_edge % 3], corner[(half_edge + 1) % 3]});
  std::uint32_t i = 0;
  while (i < midpoints_.size() && (midpoints_[i].low != low || midpoints_[i].high != high)) ++i;
  if (i == midpoints_.size()) midpoints_.push_back({low, high});
  return i;
}

/// Halves one leaf. The kept child takes the start of the edge, the new one its end. Both keep the
/// numbers of the corners, and the midpoint replaces the corner that is lost. The halves of the cut
/// edge are left without links.
void RefinedMesh::cut(Cut& cut, std::uint32_t midpoint) {
  const std::uint32_t kept = cut.half_edge / 3;
  const auto added = static_cast<std::uint32_t>(leaves_.size());
  const std::uint32_t start = cut.half_edge % 3;
  const std::uint32_t end = (start + 1) % 3;
  const std::uint32_t apex = (start + 2) % 3;

  std::array<std::uint32_t, 3> child = leaves_[kept];
  child[start] = midpoint;
  leaves_.push_back(child);
  leaves_[kept][end] = midpoint;
  leaf_submesh_.push_back(leaf_submesh_[kept]);

  // Turn the node of the leaf into the parent of two leaves.
  const auto first_child = static_cast<std::uint32_t>(nodes_.size());
  nodes_[leaf_node_[kept]] = first_child << 2U | start;
  nodes_.push_back(leaf_entry(kept));
  nodes_.push_back(leaf_entry(added));
  leaf_node_[kept] = first_child;
  leaf_node_.push_back(first_child + 1);

  for (std::uint32_t k = 0; k < 3; ++k) ring_.push_back(3 * added + k);
  // Hand the edge from end to apex over to the new child; its old number becomes the inner edge.
  // Then link the two sides of the inner edge.
  const std::uint32_t inner = 3 * kept + end;
  std::uint32_t before = inner;
  while (ring_[before] != inner) before = ring_[before];
  if (before != inner) {
    ring_[before] = 3 * added + end;
    ring_[3 * added + end] = ring_[inner];
  }
  ring_[inner] = inner;
  join_rings(inner, 3 * added + apex);
  ring_[cut.half_edge] = cut.half_edge;
  cut.start_half = cut.half_edge;
  cut.end_half = 3 * added + start;
}

/// Links the halves of the cut edge on both sides of the midpoint, and the inner edges of leaves
/// that lie on each other (both sides of a plate without thickness).
void RefinedMesh::link_cuts(std::uint32_t end_position) noexcept {
  // Turn all cuts the same way: leaves on the two sides of an edge run along it in opposite
  // directions.
  for (Cut& each : cuts_) {
    const std::uint32_t start = leaves_[each.start_half / 3][each.start_half % 3];
    if (position_id_[start] != end_position) std::swap(each.start_half, each.end_half);
  }
  const auto apex_position = [this](const Cut& each) {
    return position_id_[leaves_[each.half_edge / 3][(each.half_edge + 2) % 3]];
  };
  // Join the halves, and the inner edges of leaves that have the same apex.
  for (std::size_t i = 1; i < cuts_.size(); ++i) {
    join_rings(cuts_[0].start_half, cuts_[i].start_half);
    join_rings(cuts_[0].end_half, cuts_[i].end_half);
    for (std::size_t j = 0; j < i; ++j) {
      if (apex_position(cuts_[j]) != apex_position(cuts_[i])) continue;
      join_rings(inner_half_edge(cuts_[j].half_edge), inner_half_edge(cuts_[i].half_edge));
      break;
    }
  }
}

RefinedMesh::Place RefinedMesh::locate(std::uint32_t triangle,
                                       glm::vec2 barycentric) const noexcept {
  const float second = std::clamp(barycentric.x, 0.0F, 1.0F);
  const float third = std::clamp(barycentric.y, 0.0F, 1.0F - second);
  Place place{{}, {1.0F - second - third, second, third}};
  // Go down the tree to the half that holds the point.
  std::uint32_t entry = nodes_[triangle];
  while ((entry & 3U) != kLeafTag) {
    // Rewrite the weights for the half. If M = (A + B) / 2 and wA >= wB, then
    // wA A + wB B = (wA - wB) A + 2 wB M.
    float& start = place.weight[static_cast<int>(entry & 3U)];
    float& end = place.weight[static_cast<int>(((entry & 3U) + 1) % 3)];
    const std::uint32_t child = entry >> 2U;
    if (start >= end) {
      start -= end;
      end *= 2.0F;
      entry = nodes_[child];
    } else {
      end -= start;
      start *= 2.0F;
      entry = nodes_[child + 1];
    }
  }
  place.slot = entry >> 2U;
  place.vertex = leaves_[place.slot];
  return place;
}

void RefinedMesh::write_indices(
    std::vector<std::uint32_t>& indices,
    std::vector<std::pair<std::uint32_t, std::uint32_t>>& ranges) const {
  indices.clear();
  indices.reserve(3 * leaves_.size());
  ranges.clear();
  std::vector<std::uint32_t> open;
  for (const scene::Submesh& submesh : submeshes_) {
    const auto first = static_cast<std::uint32_t>(indices.size());
    for (std::uint32_t t = 0; t < submesh.index_count / 3; ++t) {
      // Walk the tree of each original triangle, so that its leaves stay together.
      open.assign(1, submesh.first_index / 3 + t);
      while (!open.empty()) {
        const std::uint32_t entry = nodes_[open[open.size() - 1]];
        open.pop_back();
        if ((entry & 3U) == kLeafTag) {
          const std::array<std::uint32_t, 3>& leaf = leaves_[entry >> 2U];
          indices.insert(indices.end(), leaf.begin(), leaf.end());
        } else {
          open.push_back((entry >> 2U) + 1);
          open.push_back(entry >> 2U);
        }
      }
    }
    ranges.emplace_back(first, static_cast<std::uint32_t>(indices.size()) - first);
  }
}

}  // namespace emit::renderer
