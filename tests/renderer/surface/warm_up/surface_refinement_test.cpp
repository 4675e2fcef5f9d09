// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/surface_refinement.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <span>
#include <utility>

#include "emit/physics/constants.hpp"
#include "history/foster_setup.hpp"
#include "renderer/surface/surface_scene.hpp"
#include "support/times.hpp"
#include "surface/run/cached_surface.hpp"

namespace emit::renderer {
namespace {

using emit::test::kSecondNs;
using physics::kReferenceK;
constexpr double kPixelRad = 8e-3;

TEST(SurfaceRefinement, StopsAtHalfAPixelWhereTheCameraComesClosest) {
  // A box's shadow on the ground is seen more closely than any image could show.
  test::SurfaceScene scene;
  scene.add_static(test::level_mesh(glm::vec3(-12.0F), glm::vec3(12.0F), 0.0F));
  scene.add_static(test::box_mesh(glm::vec3(-1.0F, -1.0F, 1e-3F), glm::vec3(1.0F, 1.0F, 2.0F)));
  scene::ScenarioDesc scenario;
  scenario.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
  scenario.epoch_utc_ns = 1'403'330'400 * kSecondNs;  // 2014-06-21 06:00 UTC
  scenario.thermal.model = scene::ThermalModel::foster;
  scenario.thermal.steps = 8;
  scenario.thermal.lateral = false;
  scenario.thermal.tolerance_k = 1e-3;
  scene::Material stone;
  stone.name = "stone";
  stone.layers = {{0.15, 0.7, 2120, 920}, {0.3, 1.5, 2000, 950}};
  stone.base_k = 286.15;
  stone.solar_absorptance_frac = 0.7;
  stone.emissivity_frac = 0.95;
  scenario.materials = {stone};
  scenario.default_material = "stone";
  scenario.objects.resize(scene.objects);
  scene.geometry.materials = scenario.materials;
  for (scene::Instance& instance : scene.geometry.instances) {
    instance.world_bounds =
        scene::transformed(scene.geometry.meshes[instance.mesh].bounds, instance.world_from_mesh);
  }
  const Environment environment(scenario);
  auto networks = build_foster_materials(scenario, scene.geometry.materials);
  auto surface =
      CachedSurface::create(scenario, scene.geometry, {-1, -1},
                            std::span(*networks).first(networks->size() - 1), kReferenceK);
  ASSERT_TRUE(surface.has_value());
  SurfaceHistory history(scenario.thermal.steps,
                         make_foster(scenario, std::move(*networks), environment, kReferenceK));
  StepPlan plan(scenario.thermal);
  RefineView view;
  view.pixel_rad = kPixelRad;
  // The camera comes nearer and passes.
  view.eyes = {{{-30.0, -4.0, 12.0}, {}}, {{-8.0, -4.0, 6.0}, {}}, {{-20.0, 20.0, 9.0}, {}}};
  ASSERT_TRUE((*surface)->prepare(7200 * kSecondNs, view, {environment, {}}, plan, history,
                                  std::nullopt, {}));
  const SurfaceModel& model = (*surface)->model();
  double finest_px = std::numeric_limits<double>::infinity();
  int cut = 0;
  for (std::size_t m = 0; m < model.meshes.size(); ++m) {
    const RefinedMesh& mesh = model.meshes[m];
    const std::size_t whole = scene.geometry.meshes[m].indices.size() / 3;
    for (std::uint32_t slot = 0; slot < mesh.leaf_count(); ++slot) {
      if (mesh.node(slot) < whole) continue;
      ++cut;
      std::array<glm::dvec3, 3> corners_m;
      for (std::size_t k = 0; k < 3; ++k) {
        corners_m[k] = glm::dvec3(mesh.vertices()[mesh.leaf(slot)[k]].position_m);
      }
      const double longest_m = std::max({glm::distance(corners_m[0], corners_m[1]),
                                         glm::distance(corners_m[1], corners_m[2]),
                                         glm::distance(corners_m[2], corners_m[0])});
      const glm::dvec3 centre_m = (corners_m[0] + corners_m[1] + corners_m[2]) / 3.0;
      double nearest_m = std::numeric_limits<double>::infinity();
      for (const RefineView::Eye& eye : view.eyes) {
        nearest_m = std::min(nearest_m, glm::distance(eye.world_m, centre_m));
      }
      finest_px = std::min(finest_px, longest_m / (kPixelRad * nearest_m));
    }
  }
  EXPECT_FALSE(model.full);
  EXPECT_GT(cut, 5000);
  EXPECT_LT(finest_px, 0.9);  // the limit is what stops it
  EXPECT_GT(finest_px, 0.5);
}

}  // namespace
}  // namespace emit::renderer
