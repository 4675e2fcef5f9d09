// SPDX-License-Identifier: Apache-2.0
// How finely the thermal method "cached" samples what a camera sees, and that the pictures do not
// tell: from near and far, and on the way between.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "gpu/cached_session.hpp"
#include "gpu/renderer_scene.hpp"

namespace emit::test {
namespace {

TEST(RendererCachedDetail, SamplesAreBoundedByThePixels) {
  // However small the tolerance, triangles are not cut far below a pixel.
  auto scenario = cached_scenario(box_on_ground());
  const auto pose = looking({-6.0, -9.0, 7.0}, {-1.0, 0.0, 0.0});
  scenario.sensor.trajectory = {{0, pose}};
  scenario.thermal.tolerance_k = 0.001;
  const auto samples = [&](std::uint32_t fineness) {
    scenario.sensor.width_px = fineness * kWidth;
    scenario.sensor.height_px = fineness * kHeight;
    Session run(scenario);
    (void)run.frame_k(2 * kHourNs, pose);
    EXPECT_FALSE(run.renderer().scene_stats().samples_full);
    return static_cast<double>(run.renderer().scene_stats().samples);
  };
  const double coarse = samples(1);
  const double fine = samples(2);
  EXPECT_LT(coarse, 3.0 * kWidth * kHeight);
  EXPECT_GT(coarse, 0.5 * kWidth * kHeight);  // the limit is what stops it
  EXPECT_LT(fine, 4.5 * coarse);
}

}  // namespace
}  // namespace emit::test
