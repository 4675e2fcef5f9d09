// SPDX-License-Identifier: Apache-2.0
// The solution of a whole scene: a block on the ground that the test builds.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>

#include "emit/physics/constants.hpp"
#include "emit/reference/solve.hpp"
#include "emit/reference/voxel_model.hpp"
#include "solid_scenes.hpp"
#include "support/sanitizer.hpp"

namespace emit::reference {
namespace {

/// Returns a solid cube of 0.4 m on 6 m of asphalt, on a summer's forenoon.
TestScene block_scene() {
  TestScene t;
  scene::Material asphalt;
  asphalt.name = "asphalt";
  asphalt.solar_absorptance_frac = 0.75;
  asphalt.emissivity_frac = 0.93;
  asphalt.layers = {{0.15, 0.7, 2120.0, 920.0}};
  asphalt.base_k = 293.15;
  scene::Material concrete = asphalt;
  concrete.name = "concrete";
  concrete.solar_absorptance_frac = 0.6;
  concrete.emissivity_frac = 0.88;
  concrete.layers = {{0.10, 1.28, 2300.0, 878.0}};
  t.geometry.materials = {asphalt, concrete};
  scene::Mesh ground;
  add_quad(ground, {{{-3, -3, 0}, {3, -3, 0}, {3, 3, 0}, {-3, 3, 0}}});
  finish_mesh(t, std::move(ground), 0);
  scene::Mesh block;
  add_box(block, {-0.2, -0.2, 0.0}, {0.2, 0.2, 0.4});
  finish_mesh(t, std::move(block), 1);

  t.scenario.name = "test-block";
  t.scenario.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
  t.scenario.epoch_utc_ns = 1403330400LL * 1'000'000'000LL;  // the date is 2014-06-21T06:00:00Z
  t.scenario.materials = t.geometry.materials;
  t.scenario.default_material = "asphalt";
  t.scenario.bands = {{"8-12", 8.0, 12.0, {}}};
  t.scenario.objects.resize(1);
  t.scenario.objects[0].name = "scene";
  t.scenario.thermal.initial_k = 293.15;
  t.scenario.atmosphere.enabled = false;
  return t;
}

SolveOptions quick() {
  SolveOptions options;
  options.refine = 0.3;
  options.tolerance_k = 0.003;
  options.rays = 64;
  return options;
}

SolveView view_at(double time_s, const glm::dvec3& eye, const glm::dvec3& target) {
  SolveView view;
  view.sim_time_ns = std::llround(time_s * 1e9);
  view.sensor_pose = {eye, physics::world_from_body_look_at(eye, target)};
  view.width_px = 64;
  view.height_px = 48;
  view.fov_h_rad = 0.6;
  return view;
}

TEST(ReferenceSolve, VoxelModelFindsCoreGroundAndOpenFaces) {
  const TestScene t = block_scene();
  const auto model = VoxelModel::build(t.scenario, t.geometry, {});
  ASSERT_TRUE(model.has_value()) << model.error().text;
  EXPECT_NEAR(model->steady_k({2.0, 2.0, -0.15}, 303.15), 293.15, 1e-9);
  EXPECT_NEAR(model->steady_k({2.0, 2.0, 0.0}, 303.15), 303.15, 1e-9);
  EXPECT_NEAR(model->steady_k({0.0, 0.0, 0.35}, 303.15), 298.15, 1e-9);
  EXPECT_NEAR(model->steady_k({0.0, 0.0, 0.2}, 303.15), 293.15, 1e-9);
  // The core takes everything that lies deeper than the layers' thickness.
  const SolidGrid& grid = model->grid();
  double core_m3 = 0.0;
  for (std::size_t k = 0; k < grid.count(2); ++k) {
    if (grid.lines_m[2][k] < -1e-9) continue;
    for (std::size_t j = 0; j < grid.count(1); ++j) {
      for (std::size_t i = 0; i < grid.count(0); ++i) {
        if (grid.cells[grid.index(i, j, k)] != kFixedCell) continue;
        core_m3 += (grid.lines_m[0][i + 1] - grid.lines_m[0][i]) *
                   (grid.lines_m[1][j + 1] - grid.lines_m[1][j]) *
                   (grid.lines_m[2][k + 1] - grid.lines_m[2][k]);
      }
    }
  }
  EXPECT_NEAR(core_m3, 0.2 * 0.2 * 0.3, 1e-6);
}

/// Returns the largest cell along an axis that reaches into [low, high].
double widest_m(const SolidGrid& grid, std::size_t axis, double low, double high) {
  const std::vector<double>& lines = grid.lines_m[axis];
  double widest = 0.0;
  for (std::size_t i = 0; i + 1 < lines.size(); ++i) {
    if (lines[i + 1] > low && lines[i] < high) widest = std::max(widest, lines[i + 1] - lines[i]);
  }
  return widest;
}

TEST(ReferenceSolve, CellsAreSmallWhereAShadowEdgeIsStillSharp) {
  const TestScene t = block_scene();
  const glm::dvec3 to_sun = glm::normalize(glm::dvec3(1.0, 0.2, 1.0));
  // The block is 0.4 m high and shades x from -0.2 to -0.6. The edge of its top's shadow lies at
  // -0.6.
  VoxelOptions late;
  late.suns = {{to_sun, 0.0}};
  VoxelOptions old;
  old.suns = {{to_sun, 7200.0}};
  const auto sharp = VoxelModel::build(t.scenario, t.geometry, late);
  const auto soft = VoxelModel::build(t.scenario, t.geometry, old);
  ASSERT_TRUE(sharp.has_value() && soft.has_value());
  EXPECT_LT(widest_m(sharp->grid(), 0, -0.605, -0.595), 1.2 * late.shadow_cell_m);
  EXPECT_GT(widest_m(soft->grid(), 0, -0.605, -0.595), 2.0 * late.shadow_cell_m);
  EXPECT_LT(widest_m(soft->grid(), 0, -0.605, -0.595), 1.2 * late.swept_cell_m);
  // Along y there are the edge of the top at -0.28 and the uprights' shadows from the foot to it.
  EXPECT_LT(widest_m(sharp->grid(), 1, -0.285, -0.275), 1.2 * late.shadow_cell_m);
  // The sides' shadows run nearly along x. Their width is across y, so x need not be fine.
  EXPECT_GT(widest_m(sharp->grid(), 0, -0.45, -0.35), 2.0 * late.shadow_cell_m);
  // Nothing changes in places without an edge.
  EXPECT_NEAR(widest_m(sharp->grid(), 0, 2.0, 2.5), widest_m(soft->grid(), 0, 2.0, 2.5), 0.05);
  EXPECT_GT(sharp->grid().cells.size(), soft->grid().cells.size());
}

TEST(ReferenceSolve, ShapesThatAreNotSolidsAreRefusedByName) {
  TestScene t = block_scene();
  t.geometry.meshes[1].submeshes[0].index_count -= 6;  // removes one side
  const auto open = VoxelModel::build(t.scenario, t.geometry, {});
  ASSERT_FALSE(open.has_value());
  EXPECT_NE(open.error().text.find("object 'scene'"), std::string::npos);
  EXPECT_FALSE(VoxelModel::fits(t.scenario, t.geometry).has_value());
  t = block_scene();
  t.geometry.instances[1].world_from_mesh =
      glm::rotate(glm::dmat4(1.0), 0.3, glm::dvec3(0.0, 0.0, 1.0));
  EXPECT_FALSE(VoxelModel::fits(t.scenario, t.geometry).has_value());
}

TEST(ReferenceSolve, FarFromTheBlockThreeDimensionsAgreeWithOne) {
  TestScene t = block_scene();
  // Level faces have a film of about 13 W m-2 K-1 in this breeze.
  t.scenario.clear_sky.wind_m_s = 3.2;
  SolveOptions options = quick();
  options.refine = test::kThreadSanitizer ? 0.4 : 0.7;
  const double bound_k = test::kThreadSanitizer ? 0.1 : 0.02;
  const SolveView view = view_at(1800.0, {2.0, 2.0, 1.0}, {2.6, 2.6, 0.0});
  options.dimension = SolveDimension::three;
  const auto three = solve(t.scenario, t.geometry, std::span(&view, 1), options);
  ASSERT_TRUE(three.has_value()) << three.error().text;
  options.dimension = SolveDimension::one;
  options.pixels = 40;
  const auto one = solve(t.scenario, t.geometry, std::span(&view, 1), options);
  ASSERT_TRUE(one.has_value()) << one.error().text;
  EXPECT_EQ((*one)[0].solved_px, 40U);
  std::size_t compared = 0;
  double worst = 0.0;
  for (std::size_t p = 0; p < (*one)[0].temperature_k.size(); ++p) {
    const float a = (*one)[0].temperature_k[p];
    const float b = (*three)[0].temperature_k[p];
    if (std::isnan(a) || std::isnan(b)) continue;
    EXPECT_NEAR(a, b, bound_k) << "pixel " << p;
    worst = std::max(worst, std::abs(static_cast<double>(a - b)));
    ++compared;
  }
  EXPECT_EQ(compared, 40U);
  RecordProperty("worst_k", std::to_string(worst));
}

TEST(ReferenceSolve, ShadowLiesAwayFromTheSun) {
  const TestScene t = block_scene();
  // The camera looks straight down on the block; north is at the top of the image.
  SolveView view = view_at(3600.0, {0.0, 0.0, 6.0}, {0.0, 0.0, 0.0});
  const auto images = solve(t.scenario, t.geometry, std::span(&view, 1), quick());
  ASSERT_TRUE(images.has_value()) << images.error().text;
  const SolvedImage& image = (*images)[0];
  EXPECT_EQ(image.solved_px, image.surface_px);
  const double metre_px = 32.0 / std::tan(0.3) / 6.0;
  const auto at = [&](double east_m, double north_m) {
    const auto x = static_cast<std::size_t>(32.0 + metre_px * east_m);
    const auto y = static_cast<std::size_t>(24.0 - metre_px * north_m);
    return image.temperature_k[y * view.width_px + x];
  };
  // The morning sun stands in the east.
  EXPECT_GT(at(0.5, 0.0), at(-0.4, 0.0) + 5.0F);
  EXPECT_NEAR(image.depth_m[24 * 64 + 2], 6.0F, 0.01F);
  for (const float value : image.radiance_w_m2_sr[0]) EXPECT_TRUE(std::isfinite(value));
}

TEST(ReferenceSolve, WallsSeeSunAndSkyThoughFloat32RoundsTheirPlanes) {
  // The planes of cells are rounded to a micrometre, those of triangles to float32: 0.2 and 0.3 m
  // lie on either side of them.
  for (const double half_m : {0.2, 0.25, 0.3, 0.35}) {
    TestScene t = block_scene();
    t.geometry.meshes.pop_back();
    t.geometry.instances.pop_back();
    scene::Mesh block;
    add_box(block, {-half_m, -half_m, 0.0}, {half_m, half_m, 2.0 * half_m});
    finish_mesh(t, std::move(block), 1);
    const glm::dvec3 middle{0.0, 0.0, half_m};
    const std::array<SolveView, 2> views{
        view_at(1800.0, middle + glm::dvec3(3.0, 0.0, 0.0), middle),
        view_at(1800.0, middle + glm::dvec3(-3.0, 0.0, 0.0), middle)};
    std::array<float, 2> wall_k{};
    for (std::size_t i = 0; i < views.size(); ++i) {
      const auto images = solve(t.scenario, t.geometry, std::span(&views[i], 1), quick());
      ASSERT_TRUE(images.has_value()) << images.error().text;
      wall_k[i] = (*images)[0].temperature_k[24 * 64 + 32];
    }
    // The sun stands in the east. Within half an hour it warms that wall by 10 K.
    EXPECT_GT(wall_k[0], wall_k[1] + 5.0F) << half_m;
    EXPECT_LT(wall_k[1], 296.0F) << half_m;
  }
}

TEST(ReferenceSolve, ResumedRunGivesTheSameBitsAndAMisfitIsRefused) {
  TestScene t = block_scene();
  SolveOptions options = quick();
  options.refine = 0.2;
  const SolveView view = view_at(900.0, {2.0, 2.0, 1.5}, {0.0, 0.0, 0.0});
  auto whole = SceneSolver::create(t.scenario, t.geometry, options, view.sim_time_ns);
  ASSERT_TRUE(whole.has_value()) << whole.error().text;
  ASSERT_TRUE(whole->advance_to(view.sim_time_ns).has_value());

  options.checkpoint =
      std::filesystem::path(EMIT_TEST_BINARY_DIR) / "tests" / "reference_solve_checkpoint";
  std::filesystem::remove_all(options.checkpoint);
  options.checkpoint_steps = 3;
  int calls = 0;
  options.progress = [&](double done_frac) { return done_frac <= 0.0 || ++calls < 7; };
  auto broken = SceneSolver::create(t.scenario, t.geometry, options, view.sim_time_ns);
  ASSERT_TRUE(broken.has_value()) << broken.error().text;
  ASSERT_TRUE(broken->advance_to(view.sim_time_ns).has_value());
  ASSERT_TRUE(broken->stopped());

  options.progress = {};
  auto resumed = SceneSolver::create(t.scenario, t.geometry, options, view.sim_time_ns);
  ASSERT_TRUE(resumed.has_value()) << resumed.error().text;
  ASSERT_TRUE(resumed->advance_to(view.sim_time_ns).has_value());
  EXPECT_TRUE(resumed->report().resumed);
  ASSERT_LT(broken->report().stats.steps, resumed->report().stats.steps);
  const auto a = whole->node_k();
  const auto b = resumed->node_k();
  ASSERT_EQ(a.size(), b.size());
  ASSERT_GT(a.size(), 3000U);
  for (std::size_t i = 0; i < a.size(); ++i) ASSERT_EQ(a[i], b[i]) << "node " << i;

  t.scenario.clear_sky.wind_m_s += 1.0;
  const auto misfit = solve(t.scenario, t.geometry, std::span(&view, 1), options);
  ASSERT_FALSE(misfit.has_value());
  EXPECT_EQ(misfit.error().code, physics::ErrorCode::config);
  EXPECT_NE(misfit.error().text.find("weather"), std::string::npos) << misfit.error().text;
}

}  // namespace
}  // namespace emit::reference
