// SPDX-License-Identifier: Apache-2.0
#include "budget/frame_cost.hpp"

#include <gtest/gtest.h>

#include <array>

namespace emit::renderer {
namespace {

constexpr std::array<double, 4> kTriangles = {2e3, 4e4, 1.2e5, 3e5};
constexpr std::array<double, 3> kPixels = {2e4, 8e4, 3.3e5};

double truth_ms(double triangles, double pixels) {
  return 1.5 + 1.2e-4 * triangles + 3e-5 * pixels;
}

TEST(FrameCost, FindsWhatATriangleAndAPixelTake) {
  FrameCost cost;
  EXPECT_EQ(cost.frame_ms(1e5, 1e5), 0.0);
  for (const double triangles : kTriangles) {
    for (const double pixels : kPixels) cost.add(triangles, pixels, truth_ms(triangles, pixels));
  }
  cost.fit();
  EXPECT_NEAR(cost.frame_ms(2e5, 1e5), truth_ms(2e5, 1e5), 1e-6);
  EXPECT_NEAR(cost.frame_ms(0.0, 0.0), 1.5, 1e-6);
}

TEST(FrameCost, MoreWorkNeverTakesLess) {
  FrameCost cost;
  for (const double triangles : kTriangles) {
    // Let more pixels take less time, as caches, another program or the clock may cause.
    for (const double pixels : kPixels) cost.add(triangles, pixels, 10.0 - 1e-5 * pixels);
  }
  cost.fit();
  EXPECT_GE(cost.frame_ms(1e5, 4e5), cost.frame_ms(1e5, 1e4));
  EXPECT_GE(cost.frame_ms(4e5, 1e5), cost.frame_ms(1e4, 1e5));
  EXPECT_NEAR(cost.frame_ms(1e5, 1e5), 9.0, 1.0);
}

TEST(FrameCost, FramesThatAreAllAlikeTellTheirOwnTime) {
  FrameCost cost;
  for (int i = 0; i < 5; ++i) cost.add(1e5, 1e5, 7.0);
  cost.fit();
  EXPECT_NEAR(cost.frame_ms(1e5, 1e5), 7.0, 1e-6);
  FrameCost instant;
  instant.add(0.0, 0.0, 0.0);
  instant.fit();
  EXPECT_LT(instant.frame_ms(0.0, 0.0), 0.1);
}

}  // namespace
}  // namespace emit::renderer
