// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <glm/geometric.hpp>
#include <vector>

#include "emit/scene/mesh.hpp"

namespace emit::scene {
namespace {

using PositionBits = std::array<std::uint32_t, 3>;

PositionBits bits_of(const glm::vec3& p) {
  // Adding +0 turns -0 into +0, which is the same place.
  return {std::bit_cast<std::uint32_t>(p.x + 0.0F), std::bit_cast<std::uint32_t>(p.y + 0.0F),
          std::bit_cast<std::uint32_t>(p.z + 0.0F)};
}

/// Gives every vertex the lowest vertex at the same position.
std::vector<std::uint32_t> merged_by_position(const std::vector<glm::vec3>& positions_m) {
  std::vector<std::pair<PositionBits, std::uint32_t>> order;
  order.reserve(positions_m.size());
  for (std::uint32_t i = 0; i < positions_m.size(); ++i) {
    order.emplace_back(bits_of(positions_m[i]), i);
  }
  std::ranges::sort(order);
  std::vector<std::uint32_t> merged(positions_m.size());
  std::uint32_t first = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i == 0 || order[i].first != order[i - 1].first) first = order[i].second;
    merged[order[i].second] = first;
  }
  return merged;
}

}  // namespace

bool is_closed_surface(const Mesh& mesh) {
  if (mesh.indices.size() < 12) return false;
  if (std::ranges::any_of(mesh.submeshes, &Submesh::double_sided)) return false;

  const std::vector<std::uint32_t> merged = merged_by_position(mesh.positions_m);
  std::vector<std::uint64_t> edges;
  edges.reserve(mesh.indices.size());
  double volume6_m3 = 0.0;
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const std::array<std::uint32_t, 3> corner{merged[mesh.indices[i]], merged[mesh.indices[i + 1]],
                                              merged[mesh.indices[i + 2]]};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t from = corner[k];
      const std::uint64_t to = corner[(k + 1) % 3];
      if (from == to) return false;
      edges.push_back(from << 32U | to);
    }
    // The corners are taken relative to the box's corner, because the sum would cancel far from the
    // origin.
    const glm::dvec3 a = glm::dvec3(mesh.positions_m[corner[0]]) - mesh.bounds.min_m;
    const glm::dvec3 b = glm::dvec3(mesh.positions_m[corner[1]]) - mesh.bounds.min_m;
    const glm::dvec3 c = glm::dvec3(mesh.positions_m[corner[2]]) - mesh.bounds.min_m;
    volume6_m3 += glm::dot(a, glm::cross(b, c));
  }
  if (!(volume6_m3 > 0.0)) return false;

  std::ranges::sort(edges);
  if (std::ranges::adjacent_find(edges) != edges.end()) return false;
  std::vector<std::uint64_t> opposite;
  opposite.reserve(edges.size());
  for (const std::uint64_t edge : edges) opposite.push_back(std::rotl(edge, 32));
  std::ranges::sort(opposite);
  return edges == opposite;
}

}  // namespace emit::scene
