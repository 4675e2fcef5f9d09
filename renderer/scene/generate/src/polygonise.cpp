// SPDX-License-Identifier: Apache-2.0
#include "polygonise.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/ext/matrix_double3x3.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <unordered_map>

#include "emit/physics/check.hpp"

namespace emit::scenegen {
namespace {

using Index = std::array<int, 3>;

constexpr int kLeafCells = 4;
constexpr int kLeafPoints = kLeafCells + 1;
/// Smallest distance of a cut point from a lattice point, relative to the edge. It avoids slivers
/// of zero area.
constexpr double kMinCutFrac = 0.03;

/// Axis orders of the six tetrahedra of a lattice cell. Each tetrahedron lies along a path from
/// corner 000 to corner 111 that adds the axes in one order. With the lattice below all are
/// congruent and well shaped.
constexpr std::array<std::array<int, 3>, 6> kAxisOrders{
    {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}}};
constexpr std::size_t kEvenOrders = 3;  // the first three are even permutations

/// Even orders of a tetrahedron's corners that put one inside corner first, or two.
constexpr std::array<std::array<int, 4>, 4> kOneFirst{
    {{0, 1, 2, 3}, {1, 0, 3, 2}, {2, 0, 1, 3}, {3, 0, 2, 1}}};
constexpr std::array<int, 4> pair_first(unsigned mask) {
  switch (mask) {
    case 0b0011U:
      return {0, 1, 2, 3};
    case 0b1100U:
      return {2, 3, 0, 1};
    case 0b0101U:
      return {0, 2, 3, 1};
    case 0b1010U:
      return {3, 1, 0, 2};
    case 0b1001U:
      return {0, 3, 1, 2};
    default:
      return {1, 2, 0, 3};
  }
}

class Polygoniser {
 public:
  Polygoniser(const SignedDistance& shape, const glm::dvec3& min_m, double cell_m)
      : shape_(shape), origin_m_(min_m) {
    const double half = 0.5 * cell_m;
    world_from_lattice_ = glm::dmat3(glm::dvec3(-half, half, half), glm::dvec3(half, -half, half),
                                     glm::dvec3(half, half, -half));
    // The radius is that of the farthest corner of a lattice cube from its centre, per cell of edge
    // length.
    radius_per_cell_m_ = 0.5 * glm::length(glm::dvec3(-half, -half, 3.0 * half));
    positive_ = glm::determinant(world_from_lattice_) > 0.0;
  }

  void visit(const Index& corner, int size) {
    const glm::dvec3 centre = position(corner) + world_from_lattice_ * glm::dvec3(0.5 * size);
    if (std::abs(shape_.at(centre)) > kMaxSlope * radius_per_cell_m_ * size) {
      return;
    }
    if (size == kLeafCells) {
      cut_leaf(corner);
      return;
    }
    const int half = size / 2;
    for (int child = 0; child < 8; ++child) {
      visit({corner[0] + ((child & 1) != 0 ? half : 0), corner[1] + ((child & 2) != 0 ? half : 0),
             corner[2] + ((child & 4) != 0 ? half : 0)},
            half);
    }
  }

  Surface take() { return std::move(surface_); }

 private:
  struct Corner {
    Index at;
    double value;
  };

  [[nodiscard]] glm::dvec3 position(const Index& at) const {
    return origin_m_ + world_from_lattice_ * glm::dvec3(at[0], at[1], at[2]);
  }

  static std::size_t leaf_offset(int i, int j, int k) {
    return static_cast<std::size_t>((k * kLeafPoints + j) * kLeafPoints + i);
  }

  void cut_leaf(const Index& corner) {
    std::array<double, kLeafPoints * kLeafPoints * kLeafPoints> values{};
    bool any_inside = false;
    bool any_outside = false;
    for (int k = 0; k < kLeafPoints; ++k) {
      for (int j = 0; j < kLeafPoints; ++j) {
        for (int i = 0; i < kLeafPoints; ++i) {
          const double value = shape_.at(position({corner[0] + i, corner[1] + j, corner[2] + k}));
          values[leaf_offset(i, j, k)] = value;
          (value < 0.0 ? any_inside : any_outside) = true;
        }
      }
    }
    if (!any_inside || !any_outside) {
      return;
    }
    for (int k = 0; k < kLeafCells; ++k) {
      for (int j = 0; j < kLeafCells; ++j) {
        for (int i = 0; i < kLeafCells; ++i) {
          cut_cell(corner, {i, j, k}, values);
        }
      }
    }
  }

  template <class Values>
  void cut_cell(const Index& leaf, const Index& cell, const Values& values) {
    for (std::size_t order = 0; order < kAxisOrders.size(); ++order) {
      std::array<Corner, 4> corners{};
      Index at = cell;
      for (std::size_t c = 0; c < 4; ++c) {
        corners[c] = {{leaf[0] + at[0], leaf[1] + at[1], leaf[2] + at[2]},
                      values[leaf_offset(at[0], at[1], at[2])]};
        if (c < 3) {
          ++at[static_cast<std::size_t>(kAxisOrders[order][c])];
        }
      }
      if ((order < kEvenOrders) != positive_) {
        std::swap(corners[2], corners[3]);
      }
      cut_tetrahedron(corners);
    }
  }

  /// Cuts a right-handed tetrahedron with these corners.
  void cut_tetrahedron(const std::array<Corner, 4>& corners) {
    unsigned inside = 0;
    for (std::size_t c = 0; c < 4; ++c) {
      inside |= corners[c].value < 0.0 ? 1U << c : 0U;
    }
    const int count = __builtin_popcount(inside);
    if (count == 0 || count == 4) {
      return;
    }
    const auto cut = [&](int a, int b) {
      return cut_edge(corners[static_cast<std::size_t>(a)], corners[static_cast<std::size_t>(b)]);
    };
    if (count == 2) {
      const std::array<int, 4> p = pair_first(inside);
      const std::uint32_t ac = cut(p[0], p[2]);
      const std::uint32_t ad = cut(p[0], p[3]);
      const std::uint32_t bd = cut(p[1], p[3]);
      const std::uint32_t bc = cut(p[1], p[2]);
      surface_.indices.insert(surface_.indices.end(), {ac, ad, bd, ac, bd, bc});
      return;
    }
    const unsigned alone = count == 1 ? inside : ~inside & 0xFU;
    const std::array<int, 4>& p = kOneFirst[static_cast<std::size_t>(__builtin_ctz(alone))];
    const std::uint32_t first = cut(p[0], p[1]);
    const std::uint32_t second = cut(p[0], p[2]);
    const std::uint32_t third = cut(p[0], p[3]);
    if (count == 1) {
      surface_.indices.insert(surface_.indices.end(), {first, second, third});
    } else {
      surface_.indices.insert(surface_.indices.end(), {first, third, second});
    }
  }

  std::uint32_t cut_edge(const Corner& a, const Corner& b) {
    const bool a_is_low = a.at <= b.at;  // corners of an edge are ordered componentwise
    const Corner& low = a_is_low ? a : b;
    const Corner& high = a_is_low ? b : a;
    std::uint64_t key = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      key = key << 20U | static_cast<std::uint64_t>(low.at[axis] + (1 << 19));
      key = key << 1U | static_cast<std::uint64_t>(high.at[axis] - low.at[axis]);
    }
    const auto [entry, is_new] =
        vertex_of_edge_.emplace(key, static_cast<std::uint32_t>(surface_.positions_m.size()));
    if (is_new) {
      const double t =
          std::clamp(low.value / (low.value - high.value), kMinCutFrac, 1.0 - kMinCutFrac);
      surface_.positions_m.push_back(glm::mix(position(low.at), position(high.at), t));
    }
    return entry->second;
  }

  const SignedDistance& shape_;
  glm::dvec3 origin_m_;
  glm::dmat3 world_from_lattice_{1.0};
  double radius_per_cell_m_ = 0.0;
  bool positive_ = true;
  Surface surface_;
  std::unordered_map<std::uint64_t, std::uint32_t> vertex_of_edge_;
};

}  // namespace

Surface polygonise(const SignedDistance& shape, const glm::dvec3& min_m, const glm::dvec3& max_m,
                   double cell_m) {
  EMIT_CHECK_OP(cell_m, >, 0.0);
  Polygoniser polygoniser(shape, min_m, cell_m);
  // Lattice coordinates are sums of two world coordinates over the cell edge, all from 0 on.
  const glm::dvec3 extent = (max_m - min_m) / cell_m;
  const double farthest = std::max({extent.y + extent.z, extent.x + extent.z, extent.x + extent.y});
  int size = kLeafCells;
  while (size < static_cast<int>(std::ceil(farthest)) + 1) {
    size *= 2;
  }
  polygoniser.visit({0, 0, 0}, size);
  return polygoniser.take();
}

std::vector<glm::dvec3> smooth_normals(const Surface& surface) {
  std::vector<glm::dvec3> normals(surface.positions_m.size(), glm::dvec3(0.0));
  for (std::size_t i = 0; i < surface.indices.size(); i += 3) {
    const std::uint32_t* t = &surface.indices[i];
    const glm::dvec3 a = surface.positions_m[t[0]];
    const glm::dvec3 area =
        glm::cross(surface.positions_m[t[1]] - a, surface.positions_m[t[2]] - a);
    for (int corner = 0; corner < 3; ++corner) {
      normals[t[corner]] += area;
    }
  }
  for (glm::dvec3& normal : normals) {
    normal = glm::normalize(normal);
  }
  return normals;
}

}  // namespace emit::scenegen
