// SPDX-License-Identifier: Apache-2.0
// Edges of triangles that are exchanged until the triangles are those of Delaunay.
#include <algorithm>
#include <glm/geometric.hpp>

#include "surface/columns/instance_columns.hpp"

namespace emit::renderer::columns {
namespace {

/// Cosine between the normals of two triangles above which they lie in one plane.
constexpr double kPlaneCos = 1.0 - 1e-6;
/// Sum of the cotangents of two angles, below 0, from which on an edge between them is exchanged.
constexpr double kLeastGain = 1e-6;
/// Exchanges of edges per edge after which the rest stays as it is.
constexpr std::size_t kMostFlips = 20;

}  // namespace

void InstanceColumns::make_delaunay() {
  std::vector<std::uint32_t> open;
  for (std::uint32_t slot = 0; slot < leaf_count(); ++slot) {
    if (!any_column(leaf(slot))) continue;
    for (std::uint32_t k = 0; k < 3; ++k) open.push_back(3 * slot + k);
  }
  for (std::size_t left = kMostFlips * open.size(); left > 0 && !open.empty(); --left) {
    const std::uint32_t half_edge = open.back();
    open.pop_back();
    flip(half_edge, open);
  }
}

std::uint32_t InstanceColumns::half_edge(std::uint32_t slot, std::uint32_t from,
                                         std::uint32_t to) const {
  for (std::uint32_t k = 0; slot != kNone && k < 3; ++k) {
    if (place_m_[leaf(slot)[k]] == place_m_[from] &&
        place_m_[leaf(slot)[(k + 1) % 3]] == place_m_[to]) {
      return 3 * slot + k;
    }
  }
  return kNone;
}

void InstanceColumns::flip(std::uint32_t edge, std::vector<std::uint32_t>& open) {
  const std::uint32_t s = edge / 3;
  const std::uint32_t o = beside_[edge];
  if (o == kNone) return;
  const std::uint32_t a = leaf(s)[edge % 3];
  const std::uint32_t b = leaf(s)[(edge + 1 - 3 * s) % 3];
  const std::uint32_t c = leaf(s)[(edge + 2 - 3 * s) % 3];
  const std::uint32_t back = half_edge(o, b, a);
  if (back == kNone || beside_[back] != s) return;
  const std::uint32_t j = back - 3 * o;
  // Only vertices that both leaves have in common can change hands.
  if (leaf(o)[j] != b || leaf(o)[(j + 1) % 3] != a) return;
  const std::uint32_t d = leaf(o)[(j + 2) % 3];
  if (samples_[c].material != samples_[d].material) return;
  const glm::dvec3 n = normal(s);
  if (!(glm::dot(n, normal(o)) > kPlaneCos)) return;
  const auto cotangent = [&](std::uint32_t top) {
    const glm::dvec3 to_a = place_m_[a] - place_m_[top];
    const glm::dvec3 to_b = place_m_[b] - place_m_[top];
    return glm::dot(to_a, to_b) / std::max(glm::length(glm::cross(to_a, to_b)), 1e-300);
  };
  if (!(cotangent(c) + cotangent(d) < -kLeastGain)) return;
  const auto turns = [&](std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    return glm::dot(glm::cross(place_m_[y] - place_m_[x], place_m_[z] - place_m_[x]), n) > 0.0;
  };
  if (!turns(a, d, c) || !turns(d, b, c)) return;
  const std::uint32_t k = edge - 3 * s;
  const std::uint32_t beyond_bc = beside_[3 * s + (k + 1) % 3];
  const std::uint32_t beyond_ca = beside_[3 * s + (k + 2) % 3];
  const std::uint32_t beyond_ad = beside_[3 * o + (j + 1) % 3];
  const std::uint32_t beyond_db = beside_[3 * o + (j + 2) % 3];
  const std::uint32_t from_ad = half_edge(beyond_ad, d, a);
  const std::uint32_t from_bc = half_edge(beyond_bc, c, b);
  leaves_[s] = {a, d, c};
  leaves_[o] = {d, b, c};
  const std::array<std::uint32_t, 6> beyond{beyond_ad, o, beyond_ca, beyond_db, beyond_bc, s};
  for (std::uint32_t i = 0; i < 3; ++i) {
    beside_[3 * s + i] = beyond[i];
    beside_[3 * o + i] = beyond[3 + i];
  }
  if (from_ad != kNone) beside_[from_ad] = s;
  if (from_bc != kNone) beside_[from_bc] = o;
  for (const std::uint32_t next : {3 * s, 3 * s + 2, 3 * o, 3 * o + 1}) open.push_back(next);
}

}  // namespace emit::renderer::columns
