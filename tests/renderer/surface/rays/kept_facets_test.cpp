// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/kept_facets.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <glm/ext/matrix_transform.hpp>
#include <vector>

#include "renderer/scene/sphere.hpp"
#include "renderer/surface/surface_scene.hpp"

namespace emit::renderer {
namespace {

const std::array<glm::dvec3, 2> kEyes{glm::dvec3(0.0, 0.0, 5.0), glm::dvec3(0.0, 0.5, 5.0)};
/// The sphere's triangles look about two pixels wide.
constexpr double kFacetPixelRad = 3e-3;

scene::SceneGeometry scene_of(scene::Mesh mesh) {
  scene::SceneGeometry geometry;
  scene::Instance instance;
  instance.world_bounds = mesh.bounds;
  geometry.static_bounds = geometry.bounds = mesh.bounds;
  geometry.meshes.push_back(std::move(mesh));
  geometry.instances.push_back(instance);
  geometry.materials.resize(3);
  return geometry;
}

struct Count {
  std::size_t towards_eye = 0;
  std::size_t away = 0;
  std::size_t east = 0;  ///< of those towards the eye
};

Count count_kept(const scene::SceneGeometry& geometry, double pixel_rad,
                 const glm::vec3& to_sun = {0.0F, 0.0F, 1.0F}) {
  const scene::DetailView view{kEyes, pixel_rad};
  const std::vector<double> errors = scene::simplify_errors(geometry, view);
  EXPECT_GT(errors[0], 0.0);
  const CasterRays rays = CasterRays::create(geometry).value();
  const auto kept = kept_facets(geometry, errors, rays, view, {{to_sun}});
  EXPECT_EQ(kept.size(), geometry.meshes.size());
  const scene::Mesh& mesh = geometry.meshes[0];
  Count count;
  // A mesh without kept facets has an empty list. Simplification would keep the mesh's borders for
  // a list of false.
  if (kept[0].empty()) return count;
  EXPECT_EQ(kept[0].size(), mesh.indices.size() / 3);
  EXPECT_NE(std::ranges::count(kept[0], true), 0);
  for (std::size_t t = 0; t < kept[0].size(); ++t) {
    if (!kept[0][t]) continue;
    const glm::vec3 at_m = mesh.positions_m[mesh.indices[3 * t]];
    ++(at_m.z > 0.0F ? count.towards_eye : count.away);
    if (at_m.z > 0.0F && at_m.x > 0.05F) ++count.east;
  }
  return count;
}

TEST(KeptFacets, are_what_the_eyes_see_of_a_surface_that_bends) {
  const scene::SceneGeometry geometry = scene_of(scene::sphere(100, false));
  const Count kept = count_kept(geometry, kFacetPixelRad);
  // The visible cap is 40 % of the sphere's surface. Facets near its rim that look too slim are not
  // kept.
  const std::size_t all = geometry.meshes[0].indices.size() / 3;
  EXPECT_GT(kept.towards_eye, all / 5);
  EXPECT_LT(kept.towards_eye, all / 2);
  EXPECT_EQ(kept.away, 0U);
  EXPECT_GT(kept.east, kept.towards_eye / 3);
}

TEST(KeptFacets, none_lies_where_the_sun_never_comes) {
  scene::SceneGeometry geometry = scene_of(scene::sphere(100, false));
  const Count west =
      count_kept(geometry, kFacetPixelRad, glm::normalize(glm::vec3(-1.0F, 0.0F, 0.02F)));
  EXPECT_GT(west.towards_eye, 0U);
  EXPECT_EQ(west.east, 0U);
  EXPECT_EQ(count_kept(geometry, kFacetPixelRad, {0.0F, 0.0F, -1.0F}).towards_eye, 0U);
}

TEST(KeptFacets, none_hides_behind_something_else) {
  scene::SceneGeometry geometry = scene_of(scene::sphere(100, false));
  // A plate hangs over the eastern half. The sun reaches that half below it.
  geometry.meshes.push_back(test::level_mesh({0.0F, -3.0F, 0.0F}, {3.0F, 3.0F, 0.0F}, 1.5F));
  scene::Instance plate;
  plate.mesh = 1;
  plate.object = 1;
  plate.world_bounds = geometry.meshes[1].bounds;
  geometry.instances.push_back(plate);
  geometry.static_bounds.add(plate.world_bounds);
  geometry.bounds.add(plate.world_bounds);
  const glm::vec3 to_sun = glm::normalize(glm::vec3(0.0F, 5.0F, 0.5F));
  const Count kept = count_kept(geometry, kFacetPixelRad, to_sun);
  EXPECT_GT(kept.towards_eye, 0U);
  EXPECT_EQ(kept.east, 0U);
  geometry.instances[1].world_from_mesh = glm::translate(glm::dmat4(1.0), glm::dvec3(0, 0, 9));
  EXPECT_GT(count_kept(geometry, kFacetPixelRad, to_sun).east, 0U);
}

TEST(KeptFacets, none_is_finer_than_a_pixel_or_part_of_a_plane) {
  EXPECT_EQ(count_kept(scene_of(scene::sphere(100, false)), 3.0 * kFacetPixelRad).towards_eye, 0U);
  EXPECT_EQ(count_kept(scene_of(test::grid_mesh(60)), kFacetPixelRad).towards_eye, 0U);
}

TEST(KeptFacets, are_those_of_a_mirrored_instance_too) {
  scene::SceneGeometry geometry = scene_of(scene::sphere(100, false));
  const Count before = count_kept(geometry, kFacetPixelRad);
  geometry.instances[0].world_from_mesh = glm::scale(glm::dmat4(1.0), glm::dvec3(-1.0, 1.0, 1.0));
  const Count kept = count_kept(geometry, kFacetPixelRad);
  EXPECT_EQ(kept.away, 0U);
  EXPECT_NEAR(static_cast<double>(kept.towards_eye), static_cast<double>(before.towards_eye),
              0.02 * static_cast<double>(before.towards_eye));
}

}  // namespace
}  // namespace emit::renderer
