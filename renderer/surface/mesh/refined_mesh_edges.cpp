// SPDX-License-Identifier: Apache-2.0
#include "surface/mesh/refined_mesh_edges.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <glm/geometric.hpp>
#include <limits>

namespace emit::renderer {
namespace {

/// Empty entry of the table.
constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

/// Returns the bits of a position. Adding zero turns -0 into +0.
std::array<std::uint32_t, 3> position_bits(const glm::vec3& p_m) noexcept {
  return {std::bit_cast<std::uint32_t>(p_m.x + 0.0F), std::bit_cast<std::uint32_t>(p_m.y + 0.0F),
          std::bit_cast<std::uint32_t>(p_m.z + 0.0F)};
}

/// Returns a hash of a position. It multiplies and folds twice, because coordinates of drawn scenes
/// differ in few, high bits.
std::size_t hash(const std::array<std::uint32_t, 3>& bits) noexcept {
  std::uint64_t h = (static_cast<std::uint64_t>(bits[1]) << 32U | bits[0]) * 0x9E3779B97F4A7C15ULL;
  h ^= h >> 32U;
  h = (h ^ bits[2]) * 0xD6E8FEB86659FD93ULL;
  return static_cast<std::size_t>(h ^ h >> 32U);
}

/// Half-edge in the bucket of its position with the smaller index.
struct HalfEdge {
  std::uint32_t to;  ///< position at the end with the larger index
  std::uint32_t index;
};

/// Returns a number that looks random, so that sums over different sets of vertices differ
/// (splitmix64, Steele et al. 2014).
std::uint64_t scrambled(std::uint32_t vertex) noexcept {
  std::uint64_t x = vertex + 0x9e3779b97f4a7c15U;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31U);
}

}  // namespace

std::vector<std::uint32_t> weld_positions(std::span<const RefinedMesh::Vertex> vertices) {
  std::vector<std::uint32_t> first(vertices.size());
  // Use a hash table with open addressing, at most half full.
  std::vector<std::uint32_t> table(std::bit_ceil(2 * vertices.size() + 1), kNone);
  const std::size_t mask = table.size() - 1;
  for (std::uint32_t v = 0; v < vertices.size(); ++v) {
    const auto bits = position_bits(vertices[v].position_m);
    std::size_t at = hash(bits) & mask;
    while (table[at] != kNone && position_bits(vertices[table[at]].position_m) != bits) {
      at = (at + 1) & mask;
    }
    if (table[at] == kNone) table[at] = v;
    first[v] = table[at];
  }
  return first;
}

std::vector<std::uint32_t> link_edges(std::span<const std::array<std::uint32_t, 3>> triangles,
                                      std::span<const std::uint32_t> position_id) {
  std::vector<std::uint32_t> ring(3 * triangles.size());
  for (std::uint32_t h = 0; h < ring.size(); ++h) ring[h] = h;

  // Put half-edges into buckets by their lower position (counting sort), then sort each short
  // bucket by the upper one.
  const auto each_half_edge = [&](const auto& visit) {
    for (std::uint32_t t = 0; t < triangles.size(); ++t) {
      const std::array<std::uint32_t, 3> p{
          position_id[triangles[t][0]], position_id[triangles[t][1]], position_id[triangles[t][2]]};
      if (p[0] == p[1] || p[1] == p[2] || p[2] == p[0]) continue;
      for (std::uint32_t k = 0; k < 3; ++k) {
        const std::uint32_t next = p[(k + 1) % 3];
        visit(std::min(p[k], next), std::max(p[k], next), 3 * t + k);
      }
    }
  };
  std::vector<std::uint32_t> end(position_id.size() + 1, 0);
  each_half_edge([&](std::uint32_t from, std::uint32_t, std::uint32_t) { ++end[from + 1]; });
  for (std::size_t p = 1; p < end.size(); ++p) end[p] += end[p - 1];
  std::vector<HalfEdge> sorted(end.back());
  each_half_edge([&](std::uint32_t from, std::uint32_t to, std::uint32_t index) {
    sorted[end[from]++] = {to, index};  // end[from] turns from the start of the bucket into its end
  });

  std::size_t begin = 0;
  for (std::size_t p = 0; p < position_id.size(); ++p) {
    const std::span bucket = std::span(sorted).subspan(begin, end[p] - begin);
    begin = end[p];
    std::ranges::sort(bucket, [](const HalfEdge& a, const HalfEdge& b) {
      return a.to != b.to ? a.to < b.to : a.index < b.index;
    });
    // Link the half-edges with the same upper position to a ring.
    std::size_t first = 0;
    for (std::size_t i = 1; i <= bucket.size(); ++i) {
      if (i < bucket.size() && bucket[i].to == bucket[first].to) {
        ring[bucket[i - 1].index] = bucket[i].index;
      } else {
        ring[bucket[i - 1].index] = bucket[first].index;
        first = i;
      }
    }
  }
  return ring;
}

void find_inward(const RefinedMesh& mesh, std::uint32_t first, std::vector<glm::vec3>& inward) {
  const auto vertices = mesh.vertices();
  inward.resize(vertices.size());
  std::fill(inward.begin() + first, inward.end(), glm::vec3(0.0F));
  // Find rims by a sum that is zero inside a surface: there each neighbour follows the vertex in
  // one leaf and precedes it in another.
  std::vector<std::uint64_t> open(vertices.size() - first, 0);
  for (std::uint32_t slot = 0; slot < mesh.leaf_count(); ++slot) {
    const auto& leaf = mesh.leaf(slot);
    if (std::max({leaf[0], leaf[1], leaf[2]}) < first) continue;
    glm::vec3 centre_m(0.0F);
    for (const std::uint32_t v : leaf) centre_m += vertices[v].position_m / 3.0F;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = leaf[k];
      if (v < first) continue;
      const glm::vec3 way_m = centre_m - vertices[v].position_m;
      const float length_m = glm::length(way_m);
      if (length_m > 0.0F) inward[v] += way_m / length_m;
      open[v - first] += scrambled(leaf[(k + 1) % 3]) - scrambled(leaf[(k + 2) % 3]);
    }
  }
  // Keep the directions of rims alone, with unit length.
  for (std::size_t v = first; v < inward.size(); ++v) {
    const float length = glm::length(inward[v]);
    inward[v] = open[v - first] != 0 && length > 0.0F ? inward[v] / length : glm::vec3(0.0F);
  }
}

}  // namespace emit::renderer
