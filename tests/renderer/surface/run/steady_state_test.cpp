// SPDX-License-Identifier: Apache-2.0
// The method "cached" advances its thermal samples without the heap after the warm-up, on any
// thread. This is the work of a frame besides its GL calls.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <glm/ext/matrix_transform.hpp>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "emit/physics/constants.hpp"
#include "history/foster_setup.hpp"
#include "renderer/surface/surface_scene.hpp"
#include "support/heap_counter.hpp"
#include "support/times.hpp"
#include "surface/run/cached_surface.hpp"
#include "threads/worker_pool.hpp"

namespace emit::renderer {
namespace {

using emit::test::kSecondNs;
constexpr std::int64_t kStartNs = 7200 * kSecondNs;
using physics::kReferenceK;

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
    stone.base = scene::BaseKind::body;  // with foster each object has an interior
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
    scene_.add_entity(test::box_mesh(glm::vec3(-2.0F, -1.0F, -1.0F), glm::vec3(2.0F, 1.0F, 1.0F)));
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

  void warm_up() {
    auto networks = build_foster_materials(scenario_, scene_.geometry.materials);
    ASSERT_TRUE(networks.has_value());
    auto surface = CachedSurface::create(
        scenario_, scene_.geometry, {-1, -1, 0},
        std::span(*networks).first(networks->empty() ? 0 : networks->size() - 1), kReferenceK);
    ASSERT_TRUE(surface.has_value()) << surface.error().text;
    surface_ = std::move(*surface);
    environment_.emplace(scenario_);
    history_.emplace(scenario_.thermal.steps,
                     make_foster(scenario_, std::move(*networks), *environment_, kReferenceK));
    StepPlan plan(scenario_.thermal);
    const RefineView view{{{{0.0, -12.0, 8.0}, {}}}, 2e-2};
    ASSERT_TRUE(surface_->prepare(kStartNs, view, inputs(), plan, *history_, std::nullopt, {}));
  }
  [[nodiscard]] CachedSurface::Inputs inputs() const { return {*environment_, entities_}; }

  scene::ScenarioDesc scenario_;
  test::SurfaceScene scene_;
  std::vector<PoseHistory> entities_;
  std::optional<Environment> environment_;
  std::optional<SurfaceHistory> history_;
  std::unique_ptr<CachedSurface> surface_;
};

TEST_P(SteadyState, IntervalsOfSamplesNeedNoHeap) {
  ASSERT_NO_FATAL_FAILURE(warm_up());
  ASSERT_GT(surface_->model().samples.samples.size(), 500U);
  ASSERT_EQ(surface_->model().body_k.size(), GetParam() == scene::ThermalModel::foster ? 3U : 0U);

  const auto interval_ns =
      static_cast<std::int64_t>(scenario_.thermal.first_step_s * static_cast<double>(kSecondNs));
  constexpr std::int64_t kIntervals = 12;
  constexpr std::int64_t kFrames = 7;  // of an interval
  const float before_k = surface_->vertices(0)[0].offset_k;
  const std::uint64_t before = emit::test::heap_request_count();
  for (std::int64_t i = 1; i <= kIntervals * kFrames; ++i) {
    surface_->advance(kStartNs + i * interval_ns / kFrames, inputs(), *history_);
  }
  EXPECT_EQ(emit::test::heap_request_count() - before, 0U);
  EXPECT_NE(surface_->vertices(0)[0].offset_k, before_k);
}

TEST_P(SteadyState, NeitherDoesWhatTheHostTells) {
  ASSERT_NO_FATAL_FAILURE(warm_up());

  scene::WeatherSample dull;
  dull.air_k = 285.0;
  dull.longwave_down_w_m2 = 350.0;
  physics::Pose pose = entities_[0].at(kStartNs).pose;
  std::int64_t now_ns = kStartNs;
  std::size_t most_blocks = 0;
  const auto run = [&](int frames) {
    for (int i = 0; i < frames; ++i) {
      now_ns += kSecondNs / 4;
      surface_->advance(now_ns, inputs(), *history_);
      most_blocks = std::max(most_blocks, surface_->local_blocks());
    }
  };
  const auto drive = [&](int frames, bool on, double m_per_frame) {
    for (int i = 0; i < frames; ++i) {
      pose.position_world_m.x += m_per_frame;
      EXPECT_TRUE(entities_[0].append(now_ns + kSecondNs / 4, pose, on, false));
      run(1);
    }
  };
  const std::uint64_t before = emit::test::heap_request_count();
  drive(200, true, 0.1);
  dull.sim_time_ns = now_ns - 3 * kSecondNs;  // while blocks are on their own
  EXPECT_TRUE(environment_->append(dull));
  drive(90, true, -0.1);
  drive(10, false, 0.0);
  drive(10, true, 0.0);
  EXPECT_GT(most_blocks, 0U);
  run(300);
  dull.sim_time_ns = now_ns - 3 * kSecondNs;
  dull.air_k = 300.0;
  EXPECT_TRUE(environment_->append(dull));
  run(100);
  EXPECT_EQ(emit::test::heap_request_count() - before, 0U);
  // The entity stands where the host put it, so all blocks follow the intervals again.
  EXPECT_EQ(surface_->local_blocks(), 0U);
  for (std::size_t node = 0; node < 2; ++node) {
    for (const SampleVertex& vertex : surface_->vertices(node)) {
      ASSERT_GT(vertex.offset_k, -40.0F);
      ASSERT_LT(vertex.offset_k, 60.0F);
    }
  }
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
    threads::WorkerPool pool(threads);
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
  threads::WorkerPool pool(2);
  // The two parts wait for each other.
  std::atomic<int> arrived{0};
  pool.run(2, 1, [&](std::size_t, std::size_t) {
    ++arrived;
    while (arrived < 2) std::this_thread::yield();
  });
  EXPECT_EQ(arrived, 2);
}

}  // namespace
}  // namespace emit::renderer
