// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>
#include <random>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "surface/mesh/refined_mesh.hpp"

/// Shapes and checks for tests of refined meshes.
namespace emit::renderer {

inline constexpr std::size_t kNoLimit = 1U << 24U;

using Place3 = std::tuple<float, float, float>;
using Triangle = std::array<glm::dvec3, 3>;

inline Place3 key(const glm::vec3& p_m) {
  return {p_m.x + 0.0F, p_m.y + 0.0F, p_m.z + 0.0F};
}

/// Cuboid of six submeshes with corners of their own (creases and seams), materials 1 and 2 in
/// turn.
inline scene::Mesh box(const glm::vec3& size_m) {
  scene::Mesh mesh;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float sign : {-1.0F, 1.0F}) {
      glm::vec3 normal(0.0F);
      normal[axis] = sign;
      const auto base = static_cast<std::uint32_t>(mesh.positions_m.size());
      for (int corner = 0; corner < 4; ++corner) {
        glm::vec3 p = 0.5F * normal;
        p[(axis + 1) % 3] = corner == 1 || corner == 2 ? 0.5F : -0.5F;
        p[(axis + 2) % 3] = corner >= 2 ? 0.5F : -0.5F;
        mesh.positions_m.push_back(p * size_m);
        mesh.normals.push_back(normal);
      }
      const auto first = static_cast<std::uint32_t>(mesh.indices.size());
      const std::array<std::uint32_t, 6> front{0, 1, 2, 0, 2, 3};
      for (std::size_t i = 0; i < 6; ++i) {
        mesh.indices.push_back(base + front[sign > 0.0F ? i : 5 - i]);
      }
      mesh.submeshes.push_back({first, 6, 1 + static_cast<std::uint32_t>(axis) % 2, false});
    }
  }
  return mesh;
}

/// Octahedron with one vertex a corner; upper half of material 1, lower half of 2.
inline scene::Mesh octahedron() {
  scene::Mesh mesh;
  mesh.positions_m = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  mesh.normals = mesh.positions_m;
  mesh.indices = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
  mesh.submeshes = {{0, 12, 1, false}, {12, 12, 2, false}};
  return mesh;
}

inline Triangle corners(const RefinedMesh& mesh, std::uint32_t slot) {
  Triangle t;
  for (std::size_t k = 0; k < 3; ++k) t[k] = mesh.vertices()[mesh.leaf(slot)[k]].position_m;
  return t;
}
inline glm::dvec3 area_vector_m2(const Triangle& t) {
  return 0.5 * glm::cross(t[1] - t[0], t[2] - t[0]);
}
inline double area_m2(const RefinedMesh& mesh) {
  double sum = 0.0;
  for (std::uint32_t s = 0; s < mesh.leaf_count(); ++s) {
    sum += glm::length(area_vector_m2(corners(mesh, s)));
  }
  return sum;
}
inline double volume_m3(const RefinedMesh& mesh) {
  double sum = 0.0;
  for (std::uint32_t s = 0; s < mesh.leaf_count(); ++s) {
    const Triangle t = corners(mesh, s);
    sum += glm::dot(t[0], area_vector_m2(t)) / 3.0;
  }
  return sum;
}
inline double smallest_angle_rad(const RefinedMesh& mesh) {
  double smallest = std::numbers::pi;
  for (std::uint32_t s = 0; s < mesh.leaf_count(); ++s) {
    const Triangle t = corners(mesh, s);
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::dvec3 a = glm::normalize(t[(k + 1) % 3] - t[k]);
      const glm::dvec3 b = glm::normalize(t[(k + 2) % 3] - t[k]);
      smallest = std::min(smallest, std::acos(std::clamp(glm::dot(a, b), -1.0, 1.0)));
    }
  }
  return smallest;
}

/// Splits some leaves over and over, near one corner more often than elsewhere.
inline void split_at_random(RefinedMesh& mesh, std::uint32_t seed, int rounds) {
  std::mt19937 random(seed);
  for (int round = 0; round < rounds; ++round) {
    std::vector<std::uint32_t> slots;
    for (int i = 0; i < 6; ++i) {
      slots.push_back(static_cast<std::uint32_t>(random()) % mesh.leaf_count());
    }
    slots.push_back(0);
    ASSERT_TRUE(mesh.split(slots));
  }
}

inline void expect_watertight(const RefinedMesh& mesh) {
  std::map<std::pair<Place3, Place3>, int> edges;
  for (std::uint32_t s = 0; s < mesh.leaf_count(); ++s) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& vertices = mesh.vertices();
      const glm::vec3 a = vertices[mesh.leaf(s)[k]].position_m;
      const glm::vec3 b = vertices[mesh.leaf(s)[(k + 1) % 3]].position_m;
      ++edges[{key(a), key(b)}];
    }
  }
  for (const auto& [edge, count] : edges) {
    ASSERT_EQ(count, 1);
    const auto opposite = edges.find({edge.second, edge.first});
    ASSERT_TRUE(opposite != edges.end() && opposite->second == 1);
  }
}

/// Expects that edges are only ever halved: a vertex inside an edge shows at its middle.
inline void expect_no_vertex_inside_an_edge(const RefinedMesh& mesh) {
  std::set<Place3> places;
  for (const auto& vertex : mesh.vertices()) places.insert(key(vertex.position_m));
  for (std::uint32_t s = 0; s < mesh.leaf_count(); ++s) {
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::vec3 a = mesh.vertices()[mesh.leaf(s)[k]].position_m;
      const glm::vec3 b = mesh.vertices()[mesh.leaf(s)[(k + 1) % 3]].position_m;
      ASSERT_FALSE(places.contains(key(0.5F * a + 0.5F * b)));
    }
  }
}

}  // namespace emit::renderer
