// SPDX-License-Identifier: Apache-2.0
// The example in the documentation of emit/renderer/renderer.hpp compiles and renders a frame.
#include <gtest/gtest.h>

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "emit/renderer/renderer.hpp"
#include "support/renderer_scene.hpp"

namespace emit::renderer {
namespace {

using Planes = std::vector<std::span<const float>>;

/// Runs the example; `send` takes the planes of the frame. Returns the text of an error.
std::string run_example(const scene::ScenarioDesc& scenario, const FrameRequest& request,
                        std::span<const EntityUpdate> updates,
                        const std::function<void(const Planes&)>& send) {
#include "renderer_example.inc"
  return {};
}

TEST(ReadmeExample, renders_the_frame_that_is_requested) {
  const auto scenario = test::instant_scenario(test::write_quads("ground", {test::ground(50, 50)}));
  FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = 3'600'000'000'000;
  request.sensor_pose = {{0.0, -20.0, 10.0},
                         physics::world_from_body_look_at({0.0, -20.0, 10.0}, {0.0, 0.0, 0.0})};
  std::size_t frames = 0;
  EXPECT_EQ(run_example(scenario, request, {},
                        [&](const Planes& planes) {
                          ++frames;
                          ASSERT_EQ(planes.size(), scenario.bands.size());
                          const std::size_t pixels =
                              std::size_t{scenario.sensor.width_px} * scenario.sensor.height_px;
                          ASSERT_EQ(planes[0].size(), pixels);
                          for (const float radiance : planes[0]) ASSERT_GT(radiance, 0.0F);
                        }),
            "");
  EXPECT_EQ(frames, 1U);
  scene::ScenarioDesc wrong = scenario;
  wrong.thermal.steps = 0;
  EXPECT_NE(run_example(wrong, request, {}, [](const Planes&) {}), "");
}

}  // namespace
}  // namespace emit::renderer
