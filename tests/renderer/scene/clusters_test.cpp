// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/clusters.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <set>
#include <span>
#include <vector>

#include "renderer/scene/sphere.hpp"

namespace emit::scene {
namespace {

using Triangles = std::multiset<std::array<std::uint32_t, 3>>;

Triangles triangles(const Mesh& mesh, const Submesh& submesh) {
  Triangles out;
  for (std::uint32_t i = 0; i < submesh.index_count; i += 3) {
    std::array<std::uint32_t, 3> t{};
    std::copy_n(mesh.indices.begin() + submesh.first_index + i, 3, t.begin());
    std::ranges::rotate(t, std::ranges::min_element(t));  // same winding, any first corner
    out.insert(t);
  }
  return out;
}

/// Counts indices that one of the 48 before them repeats.
std::size_t repeats(const Mesh& mesh) {
  std::size_t near = 0;
  for (std::size_t i = 48; i < mesh.indices.size(); ++i) {
    const auto window = std::span(mesh.indices).subspan(i - 48, 48);
    if (std::ranges::find(window, mesh.indices[i]) != window.end()) ++near;
  }
  return near;
}

/// Makes a sphere whose neighbouring triangles lie far apart in the list.
Mesh shuffled_sphere() {
  Mesh mesh = sphere(60, true);
  for (const Submesh& submesh : mesh.submeshes) {
    for (std::uint32_t i = 0; i + 3 < submesh.index_count / 2; i += 6) {
      for (std::uint32_t k = 0; k < 3; ++k) {
        std::swap(mesh.indices[submesh.first_index + i + k],
                  mesh.indices[submesh.first_index + submesh.index_count - 3 - i + k]);
      }
    }
  }
  return mesh;
}

/// Cuts a submesh into clusters whose indices count from the mesh's first.
std::vector<Cluster> cut(Mesh& mesh, const Submesh& submesh) {
  std::vector<Cluster> clusters = cut_into_clusters(
      mesh.positions_m, std::span(mesh.indices).subspan(submesh.first_index, submesh.index_count));
  for (Cluster& cluster : clusters) cluster.first_index += submesh.first_index;
  return clusters;
}

TEST(Clusters, keep_the_triangles_of_every_submesh_and_bring_neighbours_together) {
  Mesh mesh = shuffled_sphere();
  const Mesh before = mesh;
  std::vector<Cluster> clusters;
  for (const Submesh& submesh : mesh.submeshes) {
    for (Cluster& cluster : cut(mesh, submesh)) clusters.push_back(cluster);
  }
  for (std::size_t s = 0; s < 2; ++s) {
    EXPECT_EQ(triangles(mesh, mesh.submeshes[s]), triangles(before, before.submeshes[s]));
  }
  EXPECT_GT(repeats(mesh), repeats(before));
  EXPECT_GT(repeats(mesh), mesh.indices.size() * 3 / 4);
  // They cover the indices one after the other and end where a submesh ends.
  std::uint32_t next = 0;
  std::set<std::uint32_t> starts;
  for (const Cluster& cluster : clusters) {
    EXPECT_EQ(cluster.first_index, next);
    starts.insert(next);
    next += cluster.index_count;
    EXPECT_LE(cluster.index_count, 3 * kClusterTriangles);
  }
  EXPECT_EQ(next, mesh.indices.size());
  EXPECT_TRUE(starts.contains(mesh.submeshes[1].first_index));
  EXPECT_LT(clusters.size(), 3 * mesh.indices.size() / 3 / kClusterTriangles);
}

TEST(Clusters, at_the_ends_of_float32_every_triangle_stays_and_is_always_drawn) {
  for (const float size_m : {1e-25F, 1e25F}) {
    Mesh mesh = shuffled_sphere();
    for (glm::vec3& position_m : mesh.positions_m) position_m *= size_m;
    std::vector<Triangles> before;
    for (const Submesh& submesh : mesh.submeshes) before.push_back(triangles(mesh, submesh));
    std::vector<Cluster> clusters;
    for (const Submesh& submesh : mesh.submeshes) {
      for (Cluster& cluster : cut(mesh, submesh)) clusters.push_back(cluster);
    }
    std::uint32_t next = 0;
    for (const Cluster& cluster : clusters) {
      EXPECT_EQ(cluster.first_index, next);
      EXPECT_FALSE(std::isnan(cluster.radius_m));
      next += cluster.index_count;
    }
    EXPECT_EQ(next, mesh.indices.size());
    for (std::size_t i = 0; i < before.size(); ++i) {
      EXPECT_EQ(triangles(mesh, mesh.submeshes[i]), before[i]) << size_m;
    }
  }
}

TEST(Clusters, the_box_of_a_cluster_is_the_smallest_around_it) {
  Mesh mesh = sphere(60, false);
  for (const Cluster& cluster : cut(mesh, mesh.submeshes[0])) {
    glm::vec3 reach_m(0.0F);
    for (std::uint32_t i = 0; i < cluster.index_count; ++i) {
      const glm::vec3& at_m = mesh.positions_m[mesh.indices[cluster.first_index + i]];
      reach_m = glm::max(reach_m, glm::abs(at_m - cluster.box_centre_m));
    }
    for (glm::length_t axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(reach_m[axis], cluster.box_half_m[axis], 1e-6F);
    }
  }
}

TEST(Clusters, a_cluster_lies_in_its_sphere_and_its_cone_tells_its_back) {
  Mesh mesh = sphere(60, false);
  std::size_t turned = 0;
  for (const Cluster& cluster : cut(mesh, mesh.submeshes[0])) {
    for (const glm::vec3 eye_m : {glm::vec3(3.0F, 0.0F, 0.0F), glm::vec3(0.3F, -1.2F, 2.0F)}) {
      const bool back = glm::dot(glm::normalize(cluster.cone_apex_m - eye_m), cluster.cone_axis) >=
                        cluster.cone_cutoff;
      turned += back ? 1 : 0;
      for (std::uint32_t i = 0; i < cluster.index_count; i += 3) {
        std::array<glm::vec3, 3> p{};
        for (std::uint32_t k = 0; k < 3; ++k) {
          p[k] = mesh.positions_m[mesh.indices[cluster.first_index + i + k]];
          EXPECT_LE(glm::distance(p[k], cluster.centre_m), 1.0001F * cluster.radius_m);
        }
        const glm::vec3 normal = glm::cross(p[1] - p[0], p[2] - p[0]);
        if (back) {
          EXPECT_LE(glm::dot(normal, eye_m - p[0]), 0.0F);
        }
      }
    }
  }
  EXPECT_GT(turned, 20U);
}

}  // namespace
}  // namespace emit::scene
