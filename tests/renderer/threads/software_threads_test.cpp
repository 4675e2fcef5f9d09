// SPDX-License-Identifier: Apache-2.0
// Tests that the driver names its threads as threads/software_threads expects, and that frames
// place them.
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdlib>

#include "emit/physics/frames.hpp"
#include "gl/egl_context.hpp"
#include "support/renderer_scene.hpp"
#include "threads/core_set.hpp"

namespace emit::threads {
namespace {

TEST(SoftwareThreads, AreThoseOfTheDriver) {
  const auto context = gl::EglContext::create(-1, false);
  ASSERT_TRUE(context) << context.error().text;
  if (!context->software()) {
    EXPECT_TRUE(context->threads().raster().empty());
    EXPECT_TRUE(context->threads().compute().empty());
    return;
  }
  constexpr int kMaxOfMesa = 16;
  const int cores = CoreSet::of(0).count();
  if (cores < 2 || cores > kMaxOfMesa || std::getenv("LP_NUM_THREADS") != nullptr) {
    GTEST_SKIP() << "not one thread per core";
  }
  EXPECT_EQ(context->threads().raster().size(), static_cast<std::size_t>(cores));
  EXPECT_EQ(context->threads().compute().size(), static_cast<std::size_t>(cores));
}

TEST(SoftwareThreads, ThoseThatDrawHaveACoreEachBehindAFrame) {
  const auto scenario =
      test::instant_scenario(test::write_quads("ground", {test::ground(10.0, 10.0)}));
  std::vector<pid_t> drawing;  // threads that draw; the driver shares them among contexts
  {
    const auto context = gl::EglContext::create(-1, false);
    ASSERT_TRUE(context) << context.error().text;
    drawing = context->threads().raster();
  }
  if (drawing.empty()) GTEST_SKIP() << "not one thread per core";
  auto renderer = renderer::Renderer::create(scenario, {}, {});
  ASSERT_TRUE(renderer) << renderer.error().text;
  const CoreSet all = CoreSet::of(0);
  for (const pid_t thread : drawing) all.give_to(thread);
  renderer::FrameRequest request;
  request.sensor_pose = {{0.0, -1.0, 12.0},
                         physics::world_from_body_look_at({0.0, -1.0, 12.0}, {0.0, 0.0, 0.0})};
  const int slot = (*renderer)->submit(request);
  ASSERT_GE(slot, 0);
  EXPECT_FALSE((*renderer)->collect(static_cast<renderer::SlotIndex>(slot)).device_failed);
  for (std::size_t i = 0; i < drawing.size(); ++i) {
    EXPECT_EQ(CoreSet::of(drawing[i]), all.only(i));
  }
  (*renderer)->release(static_cast<renderer::SlotIndex>(slot));
}

}  // namespace
}  // namespace emit::threads
