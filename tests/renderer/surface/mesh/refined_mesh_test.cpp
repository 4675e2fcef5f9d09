// SPDX-License-Identifier: Apache-2.0
#include "surface/mesh/refined_mesh.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <random>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "emit/physics/constants.hpp"
#include "renderer/surface/mesh/refined_mesh_support.hpp"
#include "surface/mesh/refined_mesh_edges.hpp"

namespace emit::renderer {
namespace {

TEST(RefinedMesh, starts_as_the_mesh_with_a_copy_of_each_vertex_on_a_material_seam) {
  const scene::Mesh source = octahedron();
  const RefinedMesh mesh(source, kNoLimit);
  ASSERT_EQ(mesh.leaf_count(), 8U);
  ASSERT_EQ(mesh.vertices().size(), 6U + 4U);  // the four of the equator have two materials
  for (std::uint32_t v = 0; v < 6; ++v) {
    EXPECT_EQ(mesh.vertices()[v].position_m, source.positions_m[v]);
    EXPECT_EQ(mesh.vertices()[v].parent[0], v);
    EXPECT_EQ(mesh.vertices()[v].material, v == 5 ? 2U : 1U);
  }
  for (std::uint32_t v = 6; v < 10; ++v) {
    EXPECT_EQ(mesh.vertices()[v].parent[1], v);
    EXPECT_EQ(mesh.vertices()[v].material, 2U);
  }
  for (std::uint32_t s = 0; s < 8; ++s) {
    EXPECT_EQ(mesh.submesh(s), s / 4);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& vertex = mesh.vertices()[mesh.leaf(s)[k]];
      EXPECT_EQ(vertex.position_m, source.positions_m[source.indices[std::size_t{3} * s + k]]);
      EXPECT_EQ(vertex.normal, source.normals[source.indices[std::size_t{3} * s + k]]);
      EXPECT_EQ(vertex.material, 1 + s / 4);
    }
  }
}

TEST(RefinedMesh, sheets_and_bodies_of_one_material_share_no_vertex) {
  scene::Mesh source = octahedron();
  source.submeshes[1] = {12, 12, 1, true};
  const RefinedMesh mesh(source, kNoLimit);
  ASSERT_EQ(mesh.vertices().size(), 10U);
  EXPECT_FALSE(mesh.vertices()[0].sheet);
  EXPECT_TRUE(mesh.vertices()[9].sheet);
}

TEST(RefinedMesh, random_splits_leave_no_gap_and_keep_area_volume_and_angles) {
  for (const scene::Mesh& source : {box({1.0F, 4.0F, 0.3F}), octahedron()}) {
    for (std::uint32_t seed = 0; seed < 8; ++seed) {
      RefinedMesh mesh(source, kNoLimit);
      const double area = area_m2(mesh);
      const double volume = volume_m3(mesh);
      const double angle = smallest_angle_rad(mesh);
      split_at_random(mesh, seed, 25);
      expect_watertight(mesh);
      expect_no_vertex_inside_an_edge(mesh);
      EXPECT_GT(mesh.leaf_count(), 400U);
      EXPECT_NEAR(area_m2(mesh), area, 1e-6 * area);
      EXPECT_NEAR(volume_m3(mesh), volume, 1e-6 * volume);
      EXPECT_GE(smallest_angle_rad(mesh), 0.5 * angle - 1e-3);  // Rivara's bound
    }
  }
}

TEST(RefinedMesh, new_vertices_halve_an_edge_of_their_own_kind_and_stay_inside) {
  const glm::vec3 size_m(1.0F, 4.0F, 0.3F);
  RefinedMesh mesh(box(size_m), kNoLimit);
  const auto originals = static_cast<std::uint32_t>(mesh.vertices().size());
  split_at_random(mesh, 1, 60);
  for (std::uint32_t v = 0; v < mesh.vertices().size(); ++v) {
    const auto& vertex = mesh.vertices()[v];
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_LE(std::abs(vertex.position_m[axis]), 0.5F * size_m[axis]);
    }
    if (v < originals) continue;
    ASSERT_LT(std::max(vertex.parent[0], vertex.parent[1]), v);
    const auto& a = mesh.vertices()[vertex.parent[0]];
    const auto& b = mesh.vertices()[vertex.parent[1]];
    EXPECT_EQ(vertex.position_m, 0.5F * a.position_m + 0.5F * b.position_m);
    EXPECT_EQ(vertex.normal, a.normal);  // faces of a box stay flat
    EXPECT_EQ(vertex.normal, b.normal);
    EXPECT_EQ(vertex.material, a.material);
    EXPECT_EQ(vertex.material, b.material);
  }
}

TEST(RefinedMesh, normals_of_round_shapes_are_unit_means) {
  RefinedMesh mesh(octahedron(), kNoLimit);
  split_at_random(mesh, 2, 60);
  for (const auto& vertex : mesh.vertices()) {
    EXPECT_NEAR(glm::length(vertex.normal), 1.0F, 1e-6F);
    EXPECT_GT(glm::dot(vertex.normal, glm::normalize(vertex.position_m)), 0.95F);
  }
}

TEST(RefinedMesh, both_sides_of_a_crease_get_vertices_at_one_position) {
  RefinedMesh mesh(box({2.0F, 2.0F, 2.0F}), kNoLimit);
  std::vector<std::uint32_t> all(mesh.leaf_count());
  for (int pass = 0; pass < 2; ++pass) {  // the diagonals, then the edges of the box
    all.resize(mesh.leaf_count());
    for (std::uint32_t s = 0; s < all.size(); ++s) all[s] = s;
    ASSERT_TRUE(mesh.split(all));
  }
  EXPECT_EQ(mesh.leaf_count(), 6U * 8U);
  std::map<Place3, int> sides;
  for (std::size_t v = 24; v < mesh.vertices().size(); ++v) {
    ++sides[key(mesh.vertices()[v].position_m)];
  }
  ASSERT_EQ(sides.size(), 6U + 12U);
  for (const auto& [place, count] : sides) {
    const auto [x, y, z] = place;
    const bool on_edge = std::abs(x) + std::abs(y) + std::abs(z) > 1.5F;
    EXPECT_EQ(count, on_edge ? 2 : 1);
  }
}

TEST(RefinedMesh, every_listed_leaf_is_halved_once_however_often_it_is_listed) {
  RefinedMesh mesh(octahedron(), kNoLimit);
  split_at_random(mesh, 3, 30);
  std::vector<std::uint32_t> slots;
  std::vector<double> before_m2;
  for (std::uint32_t s = 0; s < mesh.leaf_count(); s += 3) {
    slots.push_back(s);
    before_m2.push_back(glm::length(area_vector_m2(corners(mesh, s))));
  }
  RefinedMesh twice = mesh;
  ASSERT_TRUE(mesh.split(slots));
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const double after_m2 = glm::length(area_vector_m2(corners(mesh, slots[i])));
    EXPECT_LE(after_m2, 0.5001 * before_m2[i]);
  }
  std::vector<std::uint32_t> doubled;
  for (const std::uint32_t slot : slots) doubled.insert(doubled.end(), {slot, slot});
  ASSERT_TRUE(twice.split(doubled));
  EXPECT_EQ(twice.leaf_count(), mesh.leaf_count());
}

TEST(RefinedMesh, finds_the_leaf_of_a_point_of_the_original_triangle) {
  const scene::Mesh source = box({1.0F, 4.0F, 0.3F});
  RefinedMesh mesh(source, kNoLimit);
  split_at_random(mesh, 4, 80);
  std::set<std::array<std::uint32_t, 3>> leaves;
  for (std::uint32_t s = 0; s < mesh.leaf_count(); ++s) leaves.insert(mesh.leaf(s));
  std::mt19937 random(5);
  for (int i = 0; i < 4000; ++i) {
    const std::uint32_t triangle = static_cast<std::uint32_t>(i) % 12;
    auto u = static_cast<float>(random() % 1025U) / 1024.0F;
    auto v = static_cast<float>(random() % 1025U) / 1024.0F;
    if (u + v > 1.0F) std::tie(u, v) = std::pair(1.0F - u, 1.0F - v);
    const RefinedMesh::Place place = mesh.locate(triangle, {u, v});
    ASSERT_TRUE(leaves.contains(place.vertex));
    glm::dvec3 expected(0.0);
    glm::dvec3 found(0.0);
    const std::array<double, 3> weight{1.0 - u - v, u, v};
    for (std::uint32_t k = 0; k < 3; ++k) {
      const std::uint32_t corner = source.indices[std::size_t{3} * triangle + k];
      expected += weight[k] * glm::dvec3(source.positions_m[corner]);
      const auto& vertex = mesh.vertices()[place.vertex[k]];
      EXPECT_EQ(vertex.normal, source.normals[corner]);
      EXPECT_GE(place.weight[static_cast<int>(k)], 0.0F);
      found +=
          static_cast<double>(place.weight[static_cast<int>(k)]) * glm::dvec3(vertex.position_m);
    }
    ASSERT_LT(glm::distance(found, expected), 2e-6);
    ASSERT_NEAR(place.weight.x + place.weight.y + place.weight.z, 1.0F, 1e-6F);
  }
}

TEST(RefinedMesh, points_a_little_outside_are_moved_onto_the_triangle) {
  RefinedMesh mesh(octahedron(), kNoLimit);
  split_at_random(mesh, 6, 20);
  for (const glm::vec2 outside : {glm::vec2(-1e-5F, 0.5F), glm::vec2(0.7F, 0.30001F),
                                  glm::vec2(1.00001F, 0.0F), glm::vec2(0.2F, -1e-5F)}) {
    const glm::vec3 weight = mesh.locate(0, outside).weight;
    EXPECT_GE(std::min({weight.x, weight.y, weight.z}), 0.0F);
    EXPECT_NEAR(weight.x + weight.y + weight.z, 1.0F, 1e-6F);
  }
}

TEST(RefinedMesh, the_limit_of_vertices_holds_and_leaves_the_mesh_whole) {
  RefinedMesh mesh(box({1.0F, 4.0F, 0.3F}), 100);
  bool complete = true;
  for (int round = 0; round < 200; ++round) {
    const std::vector<std::uint32_t> slots{static_cast<std::uint32_t>(round) % mesh.leaf_count()};
    const std::array<std::uint32_t, 3> before = mesh.leaf(slots[0]);
    const bool done = mesh.split(slots);
    EXPECT_EQ(done, mesh.leaf(slots[0]) != before);
    complete = complete && done;
    ASSERT_LE(mesh.vertices().size(), 100U);
  }
  EXPECT_FALSE(complete);
  EXPECT_GE(mesh.vertices().size(), 99U);  // a crease takes two
  expect_watertight(mesh);
}

TEST(RefinedMesh, the_same_calls_give_the_same_mesh) {
  RefinedMesh a(octahedron(), kNoLimit);
  RefinedMesh b(octahedron(), kNoLimit);
  split_at_random(a, 7, 40);
  split_at_random(b, 7, 40);
  ASSERT_EQ(a.leaf_count(), b.leaf_count());
  for (std::uint32_t s = 0; s < a.leaf_count(); ++s) ASSERT_EQ(a.leaf(s), b.leaf(s));
  ASSERT_EQ(a.vertices().size(), b.vertices().size());
}

TEST(RefinedMesh, indices_for_drawing_hold_every_leaf_once_under_its_submesh) {
  RefinedMesh mesh(box({1.0F, 4.0F, 0.3F}), kNoLimit);
  split_at_random(mesh, 8, 30);
  std::vector<std::uint32_t> indices(7);  // old contents go
  std::vector<std::pair<std::uint32_t, std::uint32_t>> ranges(7);
  mesh.write_indices(indices, ranges);
  ASSERT_EQ(indices.size(), std::size_t{3} * mesh.leaf_count());
  ASSERT_EQ(ranges.size(), 6U);
  std::set<std::pair<std::uint32_t, std::array<std::uint32_t, 3>>> drawn;
  std::uint32_t next = 0;
  for (std::uint32_t s = 0; s < ranges.size(); ++s) {
    EXPECT_EQ(ranges[s].first, next);
    next += ranges[s].second;
    for (std::uint32_t i = ranges[s].first; i < next; i += 3) {
      drawn.insert({s, {indices[i], indices[i + 1], indices[i + 2]}});
    }
  }
  EXPECT_EQ(next, indices.size());
  ASSERT_EQ(drawn.size(), mesh.leaf_count());
  for (std::uint32_t s = 0; s < mesh.leaf_count(); ++s) {
    EXPECT_TRUE(drawn.contains({mesh.submesh(s), mesh.leaf(s)}));
  }
}

TEST(RefinedMesh, branching_surfaces_and_plates_without_thickness_stay_conforming) {
  scene::Mesh source;
  source.positions_m = {{0, 0, 0}, {4, 0, 0}, {1, 2, 0}, {1, -1, 1}, {1, 0, 3}};
  source.normals.assign(5, {0, 0, 1});
  // The mesh has three wings along one edge, the first with a back side.
  source.indices = {0, 1, 2, 1, 0, 2, 0, 1, 3, 0, 1, 4};
  source.submeshes = {{0, 12, 0, true}};
  RefinedMesh mesh(source, kNoLimit);
  split_at_random(mesh, 9, 40);
  expect_no_vertex_inside_an_edge(mesh);
  std::map<std::set<Place3>, int> faces;
  for (std::uint32_t s = 0; s < mesh.leaf_count(); ++s) {
    std::set<Place3> face;
    bool first_wing = true;
    for (const std::uint32_t v : mesh.leaf(s)) {
      face.insert(key(mesh.vertices()[v].position_m));
      first_wing = first_wing && mesh.vertices()[v].position_m.z == 0.0F;
    }
    if (first_wing) ++faces[face];
  }
  for (const auto& [face, count] : faces) EXPECT_EQ(count, 2);
}

TEST(RefinedMesh, cuts_without_end_stop_at_the_resolution_of_positions) {
  RefinedMesh mesh(box({1.0F, 4.0F, 0.3F}), kNoLimit);
  const std::vector<std::uint32_t> corner{0};
  std::uint32_t before = 0;
  for (int round = 0; round < 100; ++round) {
    before = mesh.leaf_count();
    EXPECT_TRUE(mesh.split(corner));
  }
  EXPECT_EQ(mesh.leaf_count(), before);
  EXPECT_LT(mesh.leaf_count(), 2000U);
  EXPECT_GT(glm::length(area_vector_m2(corners(mesh, 0))), 0.0);
  expect_watertight(mesh);
}

TEST(RefinedMesh, leaves_alone_triangles_with_two_corners_at_one_position) {
  scene::Mesh source;
  source.positions_m = {{0, 0, 0}, {1, 0, 0}, {-0.0F, 0, 0}, {0, 1, 0}};
  source.normals.assign(4, {0, 0, 1});
  source.indices = {0, 1, 2, 0, 1, 3};
  source.submeshes = {{0, 6, 0, false}};
  RefinedMesh mesh(source, kNoLimit);
  const std::vector<std::uint32_t> slots{0, 1};
  EXPECT_TRUE(mesh.split(slots));
  EXPECT_EQ(mesh.leaf_count(), 3U);
  EXPECT_EQ(mesh.leaf(0), (std::array<std::uint32_t, 3>{0, 1, 2}));
}

/// Makes a level fan around the origin with neighbours at these angles.
scene::Mesh fan(std::initializer_list<double> angles_deg, bool closed) {
  scene::Mesh mesh;
  mesh.positions_m.emplace_back(0.0F);
  for (const double angle_deg : angles_deg) {
    const double angle = angle_deg * physics::kDegree;
    mesh.positions_m.emplace_back(std::cos(angle), std::sin(angle), 0.0);
  }
  mesh.normals.assign(mesh.positions_m.size(), {0.0F, 0.0F, 1.0F});
  const auto last = static_cast<std::uint32_t>(angles_deg.size());
  for (std::uint32_t v = 1; v <= last; ++v) {
    if (v == last && !closed) break;
    for (const std::uint32_t corner : {0U, v, v % last + 1}) mesh.indices.push_back(corner);
  }
  mesh.submeshes = {{0, static_cast<std::uint32_t>(mesh.indices.size()), 0, false}};
  return mesh;
}

TEST(FindInward, of_a_vertex_inside_is_nothing_however_uneven_its_leaves_are) {
  std::vector<glm::vec3> inward;
  // The fan has four slim leaves to the east and two wide ones for the rest.
  find_inward(RefinedMesh(fan({-20, -10, 0, 10, 20, 180}, true), kNoLimit), 0, inward);
  ASSERT_EQ(inward.size(), 7U);
  EXPECT_EQ(inward[0], glm::vec3(0.0F));
  for (std::size_t v = 1; v < inward.size(); ++v) EXPECT_NEAR(glm::length(inward[v]), 1.0F, 1e-5F);
  EXPECT_GT(inward[6].x, 0.9F);  // into the fan
}

TEST(FindInward, of_a_vertex_on_the_rim_points_into_the_leaves_however_far_they_reach) {
  std::vector<glm::vec3> inward;
  // The fan covers all but a gap of 20 degrees towards the west: directions nearly cancel.
  find_inward(RefinedMesh(fan({-170, -90, 0, 90, 170}, false), kNoLimit), 0, inward);
  EXPECT_GT(inward[0].x, 0.99F);
  // Vertices at which rims of two materials meet lie on both rims.
  find_inward(RefinedMesh(octahedron(), kNoLimit), 0, inward);
  EXPECT_EQ(inward[4], glm::vec3(0.0F));
  for (std::size_t v = 6; v < 10; ++v) EXPECT_GT(glm::length(inward[v]), 0.99F);
}

TEST(FindInward, from_a_vertex_on_gives_what_it_gives_from_the_first) {
  const RefinedMesh mesh(fan({-170, -90, 0, 90, 170}, false), kNoLimit);
  std::vector<glm::vec3> all;
  find_inward(mesh, 0, all);
  std::vector<glm::vec3> late(2, glm::vec3(7.0F));
  find_inward(mesh, 3, late);
  ASSERT_EQ(late.size(), all.size());
  for (std::size_t v = 3; v < all.size(); ++v) EXPECT_EQ(late[v], all[v]) << v;
}

}  // namespace
}  // namespace emit::renderer
