// SPDX-License-Identifier: Apache-2.0
#include "surface/mesh/cluster_levels.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <map>
#include <utility>
#include <vector>

#include "draw/cluster_view.hpp"
#include "renderer/scene/sphere.hpp"
#include "surface/mesh/cluster_groups.hpp"

namespace emit::renderer {
namespace {

struct Built {
  scene::Mesh mesh;
  std::uint32_t finest_triangles = 0;
  ClusterLevels levels;
};

/// A ball with two materials; its lit half is 10 K warmer, over a soft edge.
Built built() {
  Built out{scene::sphere(90, true), 0, {}};
  out.finest_triangles = static_cast<std::uint32_t>(out.mesh.indices.size() / 3);
  std::vector<float> value_k;
  for (const glm::vec3& p : out.mesh.positions_m) {
    value_k.push_back(10.0F * std::clamp(0.5F + 4.0F * p.x, 0.0F, 1.0F));
  }
  const VertexValues values{value_k};
  out.levels = build_cluster_levels(out.mesh, values);
  return out;
}

/// Returns the triangles drawn from that distance.
std::vector<std::uint32_t> drawn_from(const Built& built, float distance_m, double pixel_rad) {
  glm::dmat4 relworld_from_mesh(1.0);
  relworld_from_mesh[3] = glm::dvec4(0.0, 0.0, distance_m, 1.0);
  LevelLimits limits;
  limits.pixel_rad = pixel_rad;
  const ClusterView view({}, relworld_from_mesh, limits);
  std::vector<std::uint32_t> indices;
  for (std::size_t c = 0; c < built.levels.clusters.size(); ++c) {
    if (!view.fits(built.levels.levels[c])) continue;
    const scene::Cluster& cluster = built.levels.clusters[c];
    const auto first = built.mesh.indices.begin() + cluster.first_index;
    indices.insert(indices.end(), first, first + cluster.index_count);
  }
  return indices;
}

/// Counts the ends of all edges by place. A closed surface has every edge twice.
bool closed(const scene::Mesh& mesh, const std::vector<std::uint32_t>& indices) {
  std::map<std::pair<std::uint64_t, std::uint64_t>, int> edges;
  const auto key = [&](std::uint32_t v) {
    const glm::vec3& p = mesh.positions_m[v];
    const auto part = [](float x) {
      return static_cast<std::uint64_t>(std::lround((x + 2.0F) * 1e5F));
    };
    return (part(p.x) << 42U) ^ (part(p.y) << 21U) ^ part(p.z);
  };
  for (std::size_t i = 0; i < indices.size(); ++i) {
    const std::size_t next = i % 3 == 2 ? i - 2 : i + 1;
    ++edges[std::minmax(key(indices[i]), key(indices[next]))];
  }
  // The triangles of a pole have two corners in one place, so their edges there count doubly.
  return std::ranges::all_of(edges, [](const auto& edge) {
    return edge.second % 2 == 0 || edge.first.first == edge.first.second;
  });
}

TEST(ClusterLevels, the_finest_are_the_mesh_and_coarser_ones_follow) {
  const Built b = built();
  std::uint32_t finest = 0;
  for (std::size_t s = 0; s < b.mesh.submeshes.size(); ++s) {
    const auto [first, count] = b.levels.of_submesh[s];
    std::uint32_t next = b.mesh.submeshes[s].first_index;
    for (std::uint32_t c = first; c < first + count; ++c) {
      const scene::Cluster& cluster = b.levels.clusters[c];
      if (next == b.mesh.submeshes[s].first_index + b.mesh.submeshes[s].index_count) {
        EXPECT_GE(cluster.first_index, 3 * b.finest_triangles);
        continue;
      }
      EXPECT_EQ(cluster.first_index, next);
      next += cluster.index_count;
      finest += cluster.index_count / 3;
    }
  }
  EXPECT_EQ(finest, b.finest_triangles);
  EXPECT_GT(b.mesh.indices.size(), 4U * b.finest_triangles);
}

TEST(ClusterLevels, near_all_triangles_far_few_and_never_a_hole) {
  const Built b = built();
  const auto near = drawn_from(b, 2.0F, 1e-6);
  EXPECT_EQ(near.size() / 3, b.finest_triangles);
  std::size_t before = near.size();
  for (const float distance_m : {20.0F, 60.0F, 200.0F, 1000.0F}) {
    const auto indices = drawn_from(b, distance_m, 1e-3);
    EXPECT_LE(indices.size(), before) << distance_m;
    EXPECT_TRUE(closed(b.mesh, indices)) << distance_m;
    before = indices.size();
  }
  EXPECT_LT(before, near.size() / 15);
}

TEST(ClusterLevels, errors_only_grow_with_coarseness_and_hold) {
  const Built b = built();
  for (std::size_t c = 0; c < b.levels.levels.size(); ++c) {
    const ClusterLevel& level = b.levels.levels[c];
    const auto [own, coarser] = std::pair(level.own, level.coarser);
    if (!level.has_coarser) continue;
    EXPECT_LE(own.deviation_m, coarser.deviation_m);
    EXPECT_LE(own.size_m, coarser.size_m);
    for (std::size_t i = 0; i < own.edge_m.size(); ++i) {
      EXPECT_LE(own.edge_m[i], coarser.edge_m[i]);
    }
    EXPECT_LE(glm::distance(own.centre_m, coarser.centre_m) + own.radius_m,
              1.0001F * coarser.radius_m);
  }
  // Every drawn vertex lies on the ball, so the middles of its triangles show how far off the
  // surface is. It is no more than promised.
  const float distance_m = 100.0F;
  const auto indices = drawn_from(b, distance_m, 1e-3);
  ASSERT_LT(indices.size(), 2U * b.finest_triangles);
  for (std::size_t i = 0; i < indices.size(); i += 3) {
    const glm::vec3 middle_m =
        (b.mesh.positions_m[indices[i]] + b.mesh.positions_m[indices[i + 1]] +
         b.mesh.positions_m[indices[i + 2]]) /
        3.0F;
    EXPECT_GT(glm::length(middle_m), 1.0F - 2.0F * 0.25F * 1e-3F * distance_m);
  }
}

TEST(ClusterGroups, neighbours_go_together_and_nobody_is_left_out) {
  // The eight clusters lie in a row, and each shares places with the next.
  std::vector<GroupMember> members(8);
  for (std::uint32_t m = 0; m < 8; ++m) {
    members[m].places = {10 * m, 10 * m + 1, 10 * m + 10, 10 * m + 11};
    members[m].centre_m = {static_cast<float>(m), 0.0F, 0.0F};
  }
  const auto groups = group_neighbours(members, 4);
  std::vector<bool> seen(8, false);
  for (const auto& group : groups) {
    EXPECT_LE(group.size(), 4U);
    const auto [low, high] = std::ranges::minmax(group);
    EXPECT_EQ(high - low + 1, group.size());  // without gaps
    for (const std::uint32_t m : group) {
      EXPECT_FALSE(seen[m]);
      seen[m] = true;
    }
  }
  EXPECT_TRUE(std::ranges::all_of(seen, [](bool s) { return s; }));
}

}  // namespace
}  // namespace emit::renderer
