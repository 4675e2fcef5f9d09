// SPDX-License-Identifier: Apache-2.0
// Once warmed up, the thermal samples of the method "cached" are carried on without the heap, on
// whatever thread: what a frame does besides its GL calls.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <glm/ext/matrix_transform.hpp>
#include <memory>
#include <thread>
#include <vector>

#include "emit/physics/constants.hpp"
#include "passes/foster_setup.hpp"
#include "support/heap_counter.hpp"
#include "surface/cached_surface.hpp"
#include "surface/worker_pool.hpp"
#include "unit/surface_scene.hpp"

namespace emit::renderer {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr std::int64_t kStartNs = 7200 * kSecondNs;
constexpr double kReferenceK = 295.0;

/// Ground, a block, and a vehicle that drives by all the time.
class SteadyState : public ::testing::TestWithParam<scene::ThermalModel> {
 protected:
  SteadyState() {
    scenario_.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
    scenario_.epoch_utc_ns = 1'403'330'400 * kSecondNs;  // 2014-06-21 06:00 UTC
    scene::Material stone;
    stone.name = "stone";
    stone.layers = {{0.15, 0.7, 2120, 920}, {0.3, 1.5, 2000, 950}};
    stone.solar_absorptance_frac = 0.8;
    stone.emissivity_frac = 0.9;
    stone.base_k = 286.15;
    stone.modes = {{300.0, 0.5}, {5000.0, 0.5}};
    scenario_.materials = {stone};
    scenario_.default_material = "stone";
    scenario_.thermal.model = GetParam();
    scenario_.thermal.method = scene::ThermalMethod::cached;
    scenario_.thermal.steps = 4;
    scenario_.thermal.spacing = scene::StepSpacing::geometric;
    scene_.add_static(
        test::level_mesh(glm::vec3(-20.0F, -20.0F, 0.0F), glm::vec3(20.0F, 20.0F, 0.0F), 0.0F));
    scene_.add_static(test::box_mesh(glm::vec3(-1.0F, -1.0F, 0.0F), glm::vec3(1.0F, 1.0F, 2.0F)));
    scene_.add_mover(test::box_mesh(glm::vec3(-2.0F, -1.0F, -1.0F), glm::vec3(2.0F, 1.0F, 1.0F)));
    scene_.geometry.materials = {stone};
    for (scene::Instance& instance : scene_.geometry.instances) {
      instance.world_bounds = scene_.geometry.meshes[instance.mesh].bounds;
    }
    scenario_.objects.resize(3);
    scene::ObjectDesc& vehicle = scenario_.objects.back();
    vehicle.entity_id = scene_.geometry.instances.back().entity_id;
    physics::Pose from;
    from.position_world_m = {-15.0, 5.0, 1.0};
    physics::Pose to = from;
    to.position_world_m.x = 15.0;
    vehicle.instances = {from};
    vehicle.trajectory = {{0, from, true, false}, {3 * kStartNs, to, true, false}};
    entities_.emplace_back(vehicle, from);
  }

  scene::ScenarioDesc scenario_;
  test::SurfaceScene scene_;
  std::vector<PoseHistory> entities_;
};

TEST_P(SteadyState, IntervalsOfSamplesNeedNoHeap) {
  const Environment environment(scenario_);
  auto networks = build_foster_materials(scenario_, scene_.geometry.materials);
  ASSERT_TRUE(networks.has_value());
  auto surface = CachedSurface::create(
      scenario_, scene_.geometry, {-1, -1, 0},
      std::span(*networks).first(networks->empty() ? 0 : networks->size() - 1), kReferenceK);
  ASSERT_TRUE(surface.has_value()) << surface.error().text;
  SurfaceHistory history(scenario_.thermal.steps,
                         make_foster(scenario_, std::move(*networks), environment, kReferenceK));
  StepPlan plan(scenario_.thermal);
  const CachedSurface::Inputs inputs{environment, entities_};
  const RefineView view{{{{0.0, -12.0, 8.0}, {}}}, 2e-2};
  ASSERT_TRUE((*surface)->prepare(kStartNs, view, inputs, plan, history, std::nullopt, {}));
  ASSERT_GT((*surface)->model().samples.samples.size(), 500U);

  const auto interval_ns =
      static_cast<std::int64_t>(scenario_.thermal.first_step_s * static_cast<double>(kSecondNs));
  constexpr std::int64_t kIntervals = 12;
  constexpr std::int64_t kFrames = 7;  // of an interval
  const float before_k = (*surface)->vertices(0)[0].offset_k;
  const std::uint64_t before = emit::test::heap_request_count();
  for (std::int64_t i = 1; i <= kIntervals * kFrames; ++i) {
    (*surface)->advance(kStartNs + i * interval_ns / kFrames, inputs, history);
  }
  EXPECT_EQ(emit::test::heap_request_count() - before, 0U);
  EXPECT_NE((*surface)->vertices(0)[0].offset_k, before_k);
}

INSTANTIATE_TEST_SUITE_P(BothModels, SteadyState,
                         ::testing::Values(scene::ThermalModel::emit2014,
                                           scene::ThermalModel::foster),
                         [](const auto& model) {
                           return model.param == scene::ThermalModel::foster ? "foster"
                                                                             : "emit2014";
                         });

TEST(HeapCounter, SeesRequestsOfEveryKind) {
  const std::uint64_t before = emit::test::heap_request_count();
  auto number = std::make_unique<int>(7);
  EXPECT_GT(emit::test::heap_request_count(), before);
  EXPECT_EQ(*number, 7);
}

TEST(WorkerPool, EveryPartIsDoneOnceWhateverTheNumberOfThreads) {
  for (const unsigned int threads : {1U, 2U, 5U}) {
    WorkerPool pool(threads);
    std::vector<int> visits(10'000, 0);
    for (int round = 1; round <= 200; ++round) {
      pool.run(visits.size(), 37, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) ++visits[i];
      });
      ASSERT_EQ(std::ranges::count(visits, round), 10'000) << threads;
    }
    pool.run(0, 1, [&](std::size_t, std::size_t) { FAIL(); });
  }
}

TEST(WorkerPool, ThreadsShareTheWork) {
  WorkerPool pool(2);
  // Two parts that wait for each other.
  std::atomic<int> arrived{0};
  pool.run(2, 1, [&](std::size_t, std::size_t) {
    ++arrived;
    while (arrived < 2) std::this_thread::yield();
  });
  EXPECT_EQ(arrived, 2);
}

}  // namespace
}  // namespace emit::renderer
