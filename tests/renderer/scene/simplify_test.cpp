// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "emit/scene/simplify.hpp"
#include "renderer/scene/sphere.hpp"

namespace emit::scene {
namespace {

constexpr double kPixelRad = 1e-3;

SceneGeometry scene_of(Mesh mesh, std::uint32_t entity_id = 0) {
  SceneGeometry geometry;
  Instance instance;
  instance.entity_id = entity_id;
  instance.world_bounds = mesh.bounds;
  geometry.triangles = mesh.indices.size() / 3;
  geometry.meshes.push_back(std::move(mesh));
  geometry.instances.push_back(instance);
  geometry.materials.resize(2);
  return geometry;
}

SceneGeometry simplified_for(const SceneGeometry& geometry, const DetailView& view) {
  return simplified(geometry, simplify_errors(geometry, view));
}

/// Counts edges that are not shared by exactly two triangles.
std::size_t open_edges(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> uses;
  for (std::size_t i = 0; i < mesh.indices.size(); ++i) {
    const std::size_t next = i % 3 == 2 ? i - 2 : i + 1;
    ++uses[std::minmax(mesh.indices[i], mesh.indices[next])];
  }
  return static_cast<std::size_t>(
      std::ranges::count_if(uses, [](const auto& use) { return use.second != 2; }));
}

/// Returns the greatest depth of a triangle of the unit sphere's mesh below the sphere.
double sag_m(const Mesh& mesh) {
  double worst = 0.0;
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    glm::dvec3 centre(0.0);
    for (std::size_t k = 0; k < 3; ++k) {
      centre += glm::dvec3(mesh.positions_m[mesh.indices[i + k]]) / 3.0;
    }
    worst = std::max(worst, std::abs(1.0 - glm::length(centre)));
  }
  return worst;
}

TEST(Simplify, a_far_sphere_keeps_its_shape_to_half_a_pixel) {
  const std::array<glm::dvec3, 2> eyes{glm::dvec3(0.0, 0.0, 21.0), glm::dvec3(0.0, 0.0, 90.0)};
  const SceneGeometry fine = scene_of(sphere(300, false));
  const SceneGeometry coarse = simplified_for(fine, {eyes, kPixelRad});
  const Mesh& mesh = coarse.meshes[0];
  EXPECT_LT(coarse.triangles, fine.triangles / 20);
  EXPECT_EQ(coarse.triangles, mesh.indices.size() / 3);
  EXPECT_EQ(mesh.submeshes[0].index_count, mesh.indices.size());
  // A pixel covers 20 mm at the nearer eye, which is 20 m away.
  EXPECT_LT(sag_m(mesh), 0.5 * 0.020);
  EXPECT_GT(sag_m(mesh), 0.1 * 0.020);  // and it uses what it may
  // Vertices are old ones with their normals, and none is unused.
  ASSERT_EQ(mesh.positions_m.size(), mesh.normals.size());
  std::vector<char> used(mesh.positions_m.size(), 0);
  for (const std::uint32_t v : mesh.indices) used[v] = 1;
  EXPECT_EQ(std::ranges::count(used, 0), 0);
  for (std::size_t v = 0; v < mesh.normals.size(); ++v) {
    EXPECT_EQ(mesh.positions_m[v], mesh.normals[v]);
  }
}

TEST(Simplify, a_sphere_of_few_pixels_keeps_its_outline) {
  // The instances are three pixels wide, one, and a fifth.
  std::vector<std::size_t> triangles;
  for (const double away_m : {667.0, 2000.0, 10'000.0}) {
    const std::array<glm::dvec3, 1> eyes{glm::dvec3(0.0, 0.0, 1.0 + away_m)};
    const SceneGeometry coarse = simplified_for(scene_of(sphere(60, false)), {eyes, kPixelRad});
    EXPECT_LT(sag_m(coarse.meshes[0]), 2.0 * kMaxBodyFrac);
    triangles.push_back(coarse.triangles);
  }
  EXPECT_LT(triangles[0], 60U * 60U * 4U / 10U);
  EXPECT_EQ(triangles[1], triangles[0]);
  EXPECT_EQ(triangles[2], triangles[0]);
}

TEST(Simplify, the_thickness_of_a_pole_bounds_what_it_loses_but_not_that_of_a_sheet) {
  const std::array<glm::dvec3, 1> eyes{glm::dvec3(0.0, 0.0, 2000.0)};
  const auto error = [&](const glm::vec3& stretch) {
    Mesh mesh = sphere(60, false);
    mesh.bounds = {};
    for (glm::vec3& p : mesh.positions_m) {
      p *= stretch;
      mesh.bounds.add(glm::dvec3(p));
    }
    return simplify_errors(scene_of(std::move(mesh)), {eyes, kPixelRad})[0];
  };
  EXPECT_NEAR(error({0.5F, 20.0F, 0.5F}), 0.5 * kMaxBodyFrac, 1e-6);
  EXPECT_NEAR(error({20.0F, 0.01F, 20.0F}), 20.0 * kMaxBodyFrac, 1e-5);
}

TEST(Simplify, nothing_changes_where_pixels_are_finer_or_the_distance_is_unknown) {
  const std::vector<std::uint32_t> before = sphere(40, false).indices;
  const std::array<glm::dvec3, 1> near{glm::dvec3(0.0, 0.0, 2.0)};
  const std::array<glm::dvec3, 1> inside{glm::dvec3(0.0)};
  const std::array<glm::dvec3, 1> far{glm::dvec3(0.0, 0.0, 500.0)};
  EXPECT_EQ(simplified_for(scene_of(sphere(40, false)), {near, kPixelRad}).meshes[0].indices,
            before);
  EXPECT_EQ(simplified_for(scene_of(sphere(40, false)), {inside, 1.0}).meshes[0].indices, before);
  EXPECT_EQ(simplified_for(scene_of(sphere(40, false)), {{}, kPixelRad}).meshes[0].indices, before);
  // An entity may come as close as it likes.
  EXPECT_EQ(simplified_for(scene_of(sphere(40, false), 7), {far, kPixelRad}).meshes[0].indices,
            before);
  EXPECT_LT(simplified_for(scene_of(sphere(40, false)), {far, kPixelRad}).triangles,
            before.size() / 3 / 4);
}

TEST(Simplify, kept_triangles_stay_and_the_rest_meets_them) {
  const std::array<glm::dvec3, 1> eyes{glm::dvec3(0.0, 0.0, 21.0)};
  const SceneGeometry fine = scene_of(sphere(300, false));
  const Mesh& before = fine.meshes[0];
  using Corners = std::array<std::array<float, 3>, 3>;
  const auto corners = [](const Mesh& mesh, std::size_t t) {
    Corners out;
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::vec3& p = mesh.positions_m[mesh.indices[3 * t + k]];
      out[k] = {p.x, p.y, p.z};
    }
    std::ranges::rotate(out, std::ranges::min_element(out));  // which corner is first is free
    return out;
  };
  // Only the upper half is kept.
  std::vector<std::vector<bool>> kept(1);
  std::set<Corners> missing;
  for (std::size_t t = 0; t < before.indices.size() / 3; ++t) {
    const Corners here = corners(before, t);
    kept[0].push_back(std::min({here[0][2], here[1][2], here[2][2]}) > 0.0F);
    if (kept[0].back()) missing.insert(here);
  }
  const std::size_t count = missing.size();
  const SceneGeometry coarse = simplified(fine, simplify_errors(fine, {eyes, kPixelRad}), kept);
  const Mesh& mesh = coarse.meshes[0];
  EXPECT_LT(mesh.indices.size() / 3, count + (before.indices.size() / 3 - count) / 8);
  EXPECT_EQ(open_edges(mesh), open_edges(before));
  for (std::size_t t = 0; t < mesh.indices.size() / 3; ++t) missing.erase(corners(mesh, t));
  EXPECT_TRUE(missing.empty());
}

TEST(Separated, near_instances_have_a_mesh_of_their_own_and_far_ones_share) {
  SceneGeometry geometry = scene_of(sphere(8, false));
  for (const double x_m : {10.0, 1100.0, 1110.0}) {
    Instance instance = geometry.instances[0];
    instance.world_bounds.min_m.x += x_m;
    instance.world_bounds.max_m.x += x_m;
    geometry.instances.push_back(instance);
  }
  const std::array<glm::dvec3, 1> eyes{glm::dvec3(0.0, 0.0, 31.0)};
  const SceneGeometry own = separated(geometry, {eyes, kPixelRad});
  EXPECT_NE(own.instances[0].mesh, own.instances[1].mesh);
  EXPECT_EQ(own.instances[2].mesh, own.instances[3].mesh);
  EXPECT_NE(own.instances[1].mesh, own.instances[2].mesh);
  for (const Instance& instance : own.instances) {
    EXPECT_EQ(own.meshes[instance.mesh].indices, geometry.meshes[0].indices);
  }
  EXPECT_EQ(separated(geometry, {{}, kPixelRad}).meshes.size(), 1U);
}

TEST(Separated, far_instances_share_with_those_whose_pixels_are_as_wide) {
  SceneGeometry geometry = scene_of(sphere(8, false));
  const Instance near = geometry.instances[0];
  geometry.instances.clear();
  // The instances are too narrow for meshes of their own: two within an octave, one beyond, one
  // that moves.
  for (const double x_m : {2100.0, 9000.0, 3900.0, 2200.0, 8500.0}) {
    Instance instance = near;
    instance.world_bounds.min_m.x += x_m;
    instance.world_bounds.max_m.x += x_m;
    instance.entity_id = x_m == 2200.0 ? 1 : 0;
    geometry.instances.push_back(instance);
  }
  const std::array<glm::dvec3, 1> eyes{glm::dvec3(0.0)};
  const DetailView view{eyes, 1.0 / 1024.0};
  const SceneGeometry shared = separated(geometry, view);
  EXPECT_EQ(shared.instances[0].mesh, shared.instances[2].mesh);
  EXPECT_EQ(shared.instances[1].mesh, shared.instances[4].mesh);
  EXPECT_NE(shared.instances[0].mesh, shared.instances[1].mesh);
  // An entity may come as close as it likes, so instances that share its mesh could lose no
  // triangles.
  EXPECT_EQ(shared.instances[3].mesh, 0U);
  EXPECT_NE(shared.instances[0].mesh, 0U);
  EXPECT_NE(shared.instances[1].mesh, 0U);
  EXPECT_EQ(shared.meshes.size(), 3U);
  const std::vector<double> errors = simplify_errors(
      [&] {
        SceneGeometry fine = separated(scene_of(sphere(200, false)), view);
        fine.meshes.resize(3, fine.meshes[0]);
        fine.instances = shared.instances;
        return fine;
      }(),
      view, std::numeric_limits<double>::infinity());
  EXPECT_EQ(errors[0], 0.0);
  const double near_error = errors[shared.instances[0].mesh];
  EXPECT_GT(near_error, 0.0);
  EXPECT_GT(errors[shared.instances[1].mesh], 4.0 * near_error * 0.99);
}

TEST(Separated, copies_have_a_limit) {
  SceneGeometry geometry = scene_of(sphere(400, false));  // 320,000 vertices
  const Instance first = geometry.instances[0];
  for (int i = 1; i < 40; ++i) {
    Instance instance = first;
    instance.world_bounds.min_m.x += 1.5 * i * i * i;
    instance.world_bounds.max_m.x += 1.5 * i * i * i;
    geometry.instances.push_back(instance);
  }
  const std::array<glm::dvec3, 1> eyes{glm::dvec3(0.0, 0.0, 31.0)};
  const SceneGeometry own = separated(geometry, {eyes, kPixelRad});
  // There are six meshes of single instances, and the classes of six octaves.
  EXPECT_LE(own.meshes.size(), 1U + 6U + 6U);
  EXPECT_GT(own.meshes.size(), 1U + 6U);
}

TEST(Simplify, the_seam_between_two_materials_does_not_move) {
  const std::array<glm::dvec3, 1> eyes{glm::dvec3(0.0, 0.0, 31.0)};
  const SceneGeometry coarse = simplified_for(scene_of(sphere(200, true)), {eyes, kPixelRad});
  const Mesh& mesh = coarse.meshes[0];
  ASSERT_EQ(mesh.submeshes.size(), 2U);
  EXPECT_LT(coarse.triangles, 40000U);
  const auto on_seam = [&mesh](const Submesh& submesh) {
    std::set<std::pair<float, float>> places;
    for (std::uint32_t i = 0; i < submesh.index_count; ++i) {
      const glm::vec3& p = mesh.positions_m[mesh.indices[submesh.first_index + i]];
      if (std::abs(p.z) < 1e-5F) places.emplace(p.x, p.y);
    }
    return places;
  };
  const auto above = on_seam(mesh.submeshes[0]);
  EXPECT_EQ(above.size(), 400U);
  EXPECT_EQ(above, on_seam(mesh.submeshes[1]));
}

}  // namespace
}  // namespace emit::scene
