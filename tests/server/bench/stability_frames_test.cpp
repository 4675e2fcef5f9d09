// SPDX-License-Identifier: Apache-2.0
// Reduced runs of the hostile frames of `emit bench stability`: the renderer's public interface
// under scenes that ask for trouble.
#include <gtest/gtest.h>

#include "bench/stability/bench_stability_frames.hpp"

namespace emit {
namespace {

tool::HostileFrameResult hostile(const std::string& test) {
  tool::HostileFrameOptions options;
  options.width_px = 80;
  options.height_px = 64;
  options.only = {test};
  const auto results = tool::run_hostile_frames(options);
  if (!results || results->size() != 1) {
    ADD_FAILURE() << (results ? "no result" : results.error().text);
    return {};
  }
  return results->front();
}

void expect_finite(const tool::HostileFrameResult& r) {
  EXPECT_GT(r.frames, 0U) << r.test;
  EXPECT_EQ(r.nan_count, 0U) << r.test;
  EXPECT_EQ(r.inf_count, 0U) << r.test;
}

void expect_within(const std::string& test, double budget_k) {
  const auto r = hostile(test);
  expect_finite(r);
  EXPECT_EQ(r.nonfinite_px, 0U) << test;
  EXPECT_GT(r.cases, 500U) << test << ": too little of the scene was in view";
  EXPECT_LE(r.max_error_k, budget_k) << test << ": " << r.worst_input;
}

// The budgets are in kelvin. Normals of 16 bits turn a face by up to 5e-5 rad, which changes it by
// a millikelvin in full sun. Where frames are compared with frames, the rest is shadow edges that
// move by less than a texel.
TEST(StabilityFrames, GrazingSunStaysWithTheModel) {
  // A face that is nearly edge-on shades itself in part, so slopes are at least 3 degrees above the
  // sun's rays.
  expect_within("frame-grazing-sun", 0.3);
}

TEST(StabilityFrames, HistoryOfAYearStaysWithTheModel) {
  expect_within("frame-history-of-a-year", 0.02);
}

TEST(StabilityFrames, ExtremeMaterialsStayWithTheModel) {
  expect_within("frame-extreme-materials", 0.02);
}

TEST(StabilityFrames, ObscuranceOfOpenGroundIsOneHalfAtEveryRadius) {
  expect_within("frame-obscurance-radius", 0.02);
}

TEST(StabilityFrames, ZeroAreaTrianglesChangeNothing) {
  expect_within("frame-zero-area", 1e-3);
}

TEST(StabilityFrames, CoincidentFacesDoNotShadeEachOther) {
  // A device may round the depths of coincident triangles differently, which changes the width of
  // a penumbra. A face in its own shadow would be 40 K colder.
  expect_within("frame-coincident-faces", 0.02);
}

TEST(StabilityFrames, AFarAndTallWallDoesNotSwallowNearShadows) {
  const auto r = hostile("frame-depth-range-near-part");
  expect_finite(r);
  // Shaded ground is 40 K colder. The cores must stay, but the penumbra may change.
  EXPECT_LT(r.p99_error_k, 20.0) << r.worst_input;
}

TEST(StabilityFrames, HostileWeatherNeverGivesNaN) {
  const auto r = hostile("frame-hostile-weather");
  expect_finite(r);
  EXPECT_GT(r.clamped_count + r.nonfinite_px, 0U);
}

TEST(StabilityFrames, HostileCamerasNeverGiveNaN) {
  expect_finite(hostile("frame-hostile-camera"));
}

TEST(StabilityFrames, AnUnknownTestIsRefused) {
  tool::HostileFrameOptions options;
  options.only = {"frame-of-mind"};
  EXPECT_FALSE(tool::run_hostile_frames(options).has_value());
}

}  // namespace
}  // namespace emit
