// SPDX-License-Identifier: Apache-2.0
#include "ray_cone_tree.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace emit::reference {
namespace {

constexpr std::uint32_t kLeafTriangles = 8;

/// Rounds to float32 downwards.
float below(double x) noexcept {
  const float f = static_cast<float>(x);
  return static_cast<double>(f) <= x ? f
                                     : std::nextafter(f, -std::numeric_limits<float>::infinity());
}
/// Rounds to float32 upwards.
float above(double x) noexcept {
  return -below(-x);
}

/// Returns true if a cone may meet the ball around a box.
bool may_meet(const glm::vec3& low_m, const glm::vec3& high_m, const glm::dvec3& apex_m,
              const glm::dvec3& axis, double sine, double cosine) noexcept {
  const glm::dvec3 centre = 0.5 * (glm::dvec3(low_m) + glm::dvec3(high_m)) - apex_m;
  const double radius_m = 0.5 * glm::length(glm::dvec3(high_m) - glm::dvec3(low_m));
  const double along_m = glm::dot(centre, axis);
  if (along_m < -radius_m) return false;
  const double across_m = std::sqrt(std::max(glm::dot(centre, centre) - along_m * along_m, 0.0));
  // Allow for the rounding of `across_m`.
  return across_m * cosine - along_m * sine <= radius_m + 1e-7 * (std::abs(along_m) + radius_m);
}

}  // namespace

ConeTree::ConeTree(std::span<const std::array<glm::dvec3, 3>> triangles) {
  const auto count = static_cast<std::uint32_t>(triangles.size());
  if (count == 0) return;
  order_.resize(count);
  std::iota(order_.begin(), order_.end(), 0U);
  std::vector<glm::vec3> centres(count);
  // Sort by the centres of the triangles.
  for (std::uint32_t i = 0; i < count; ++i) {
    centres[i] = glm::vec3((triangles[i][0] + triangles[i][1] + triangles[i][2]) / 3.0);
  }
  nodes_.reserve(2 * (count / kLeafTriangles + 1));

  // Split at the median along the longest side of the box of centres; the depth stays logarithmic.
  struct Range {
    std::uint32_t begin, end, parent;
    bool second;
  };
  std::vector<Range> open{{0, count, 0, false}};
  while (!open.empty()) {
    const Range range = open.back();
    open.pop_back();
    const auto index = static_cast<std::uint32_t>(nodes_.size());
    if (range.second) nodes_[range.parent].first = index;
    // Bound the triangles and their centres.
    glm::dvec3 low{std::numeric_limits<double>::infinity()};
    glm::dvec3 high = -low;
    glm::vec3 centre_low{std::numeric_limits<float>::infinity()};
    glm::vec3 centre_high = -centre_low;
    for (std::uint32_t i = range.begin; i < range.end; ++i) {
      for (const glm::dvec3& corner : triangles[order_[i]]) {
        low = glm::min(low, corner);
        high = glm::max(high, corner);
      }
      centre_low = glm::min(centre_low, centres[order_[i]]);
      centre_high = glm::max(centre_high, centres[order_[i]]);
    }
    Node node{.low_m = {below(low.x), below(low.y), below(low.z)},
              .high_m = {above(high.x), above(high.y), above(high.z)}};
    // Make a leaf of a few triangles.
    if (range.end - range.begin <= kLeafTriangles) {
      node.first = range.begin;
      node.count = range.end - range.begin;
      nodes_.push_back(node);
      continue;
    }
    nodes_.push_back(node);
    const glm::vec3 size = centre_high - centre_low;
    const int axis = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
    const std::uint32_t middle = range.begin + (range.end - range.begin) / 2;
    std::nth_element(
        order_.begin() + range.begin, order_.begin() + middle, order_.begin() + range.end,
        [&](std::uint32_t a, std::uint32_t b) {
          return centres[a][axis] != centres[b][axis] ? centres[a][axis] < centres[b][axis] : a < b;
        });
    open.push_back({middle, range.end, index, true});
    // Push the first half last: it is taken next and thereby follows its parent.
    open.push_back({range.begin, middle, index, false});
  }
}

void ConeTree::query(const glm::dvec3& apex_m, const glm::dvec3& axis, double semi_angle_rad,
                     std::vector<std::uint32_t>& out) const {
  if (nodes_.empty()) return;
  const double sine = std::sin(semi_angle_rad);
  const double cosine = std::cos(semi_angle_rad);
  // Walk down all boxes that the cone may meet.
  std::array<std::uint32_t, 64> stack;
  std::size_t depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const std::uint32_t index = stack[--depth];
    const Node& node = nodes_[index];
    if (!may_meet(node.low_m, node.high_m, apex_m, axis, sine, cosine)) continue;
    if (node.count > 0) {
      out.insert(out.end(), order_.begin() + node.first, order_.begin() + node.first + node.count);
    } else {
      stack[depth++] = node.first;
      stack[depth++] = index + 1;
    }
  }
}

}  // namespace emit::reference
