// SPDX-License-Identifier: Apache-2.0
// Shade of entities on triangles that are far larger than the shade: each pixel has it where it is
// and was.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "support/cached_session.hpp"

namespace emit::test {
namespace {

/// Scenario with a plate that the host moves over one large square of ground.
struct Plate {
  static constexpr double kHalfEastM = 4.0;
  static constexpr double kHalfNorthM = 2.0;
  static constexpr double kHeightM = 6.0;
  static constexpr double kFromS = 7245.0;

  scene::ScenarioDesc scenario = cached_scenario(write_quads("ground", {ground(40.0, 40.0)}));
  physics::Pose eye = looking({0.0, -0.001, 28.0}, {0.0, 0.0, 0.0});

  Plate() {
    scene::ObjectDesc plate = scenario.objects.front();
    plate.name = "plate";
    plate.gltf = write_quads("plate", {ground(kHalfEastM, kHalfNorthM)});
    plate.entity_id = 7;
    plate.instances = {at(60.0)};
    scenario.objects.push_back(plate);
  }
  /// Pose of the plate whose shade has its centre `east_m` east of the origin at 7300 s.
  [[nodiscard]] physics::Pose at(double east_m) const {
    const glm::dvec3 sun = to_sun(scenario, 7300.0);
    physics::Pose pose = scenario.objects.front().instances.front();
    pose.position_world_m = kHeightM / sun.z * sun + glm::dvec3(east_m, 0.0, 0.0);
    return pose;
  }
  /// Distance from the edge of the plate's shade to a point of the ground inside it; negative
  /// outside.
  [[nodiscard]] double inside_m(const glm::dvec3& point_m, double east_m, double now_s) const {
    const glm::dvec3 sun = to_sun(scenario, now_s);
    const glm::dvec3 aside_m = point_m + kHeightM / sun.z * sun - at(east_m).position_world_m;
    return std::min(kHalfEastM - std::abs(aside_m.x), kHalfNorthM - std::abs(aside_m.y));
  }
  [[nodiscard]] glm::dvec3 ground_at(std::size_t pixel) const {
    const auto x = static_cast<std::uint32_t>(pixel % kWidth);
    const auto y = static_cast<std::uint32_t>(pixel / kWidth);
    return world_point(scenario.sensor, eye, x, y, eye.position_world_m.z);
  }
  /// True when the plate, made larger by `rim_m` on every side, hides a point of the ground.
  [[nodiscard]] bool hidden(const glm::dvec3& point_m, double east_m, double rim_m = 0.3) const {
    const glm::dvec3& eye_m = eye.position_world_m;
    const glm::dvec3 there_m = eye_m + (eye_m.z - kHeightM) / eye_m.z * (point_m - eye_m);
    const glm::dvec3 aside_m = there_m - at(east_m).position_world_m;
    return std::abs(aside_m.x) < kHalfEastM + rim_m && std::abs(aside_m.y) < kHalfNorthM + rim_m;
  }
};

void tell(Session& session, double now_s, const physics::Pose& pose) {
  const renderer::EntityUpdate update{7, pose, true, false};
  EXPECT_EQ(session.renderer().apply_entities(std::llround(now_s * 1e9), {&update, 1}), 1U);
}

TEST(RendererCachedShade, WhatTheHostParksLeavesAPrintWithItsOwnEdges) {
  const Plate world;
  Session run(world.scenario);
  constexpr double kArrivesS = 7250.0;
  constexpr double kLeavesS = 7290.0;
  int shaded = 0;
  int open = 0;
  int own = 0;
  for (std::int64_t tenth = 72450; tenth <= 73100; tenth += 2) {
    const double now_s = 0.1 * static_cast<double>(tenth);
    const bool parked = now_s >= kArrivesS && now_s < kLeavesS;
    const double east_m = parked ? 0.0 : 60.0;
    const renderer::EntityUpdate update{7, world.at(east_m), true, true};
    ASSERT_EQ(run.renderer().apply_entities(std::llround(now_s * 1e9), {&update, 1}), 1U);
    const auto frame = run.frame_k(std::llround(now_s * 1e9), world.eye);
    if (tenth != 72700 && tenth != 72880 && tenth != 73000 && tenth != 73100) continue;
    const std::int64_t now_ns = std::llround(now_s * 1e9);
    const double open_k = open_ground_k(world.scenario, now_ns);
    const double shaded_k =
        open_ground_k(world.scenario, now_ns, Shade{kArrivesS, std::min(kLeavesS, now_s)});
    ASSERT_GT(open_k - shaded_k, 0.4);
    for (std::size_t i = 0; i < frame.size(); ++i) {
      const glm::dvec3 point_m = world.ground_at(i);
      if (parked && world.hidden(point_m, east_m, -0.3)) {
        // Expect no shade of the plate on itself, although it lies on the same rays to the sun.
        EXPECT_NEAR(frame[i], open_k, 0.1);
        ++own;
      }
      if (parked && world.hidden(point_m, east_m)) continue;
      // Leave out the edge, because the shade moves by a few centimetres.
      const double inside_m = world.inside_m(point_m, 0.0, 7270.0);
      if (std::abs(inside_m) < 0.3) continue;
      const double expected_k = inside_m > 0.0 ? shaded_k : open_k;
      EXPECT_NEAR(frame[i], expected_k, 0.1 * (open_k - shaded_k) + 0.03)
          << now_s << " s, " << point_m.x << ' ' << point_m.y << ", inside " << inside_m;
      (inside_m > 0.0 ? shaded : open) += 1;
    }
  }
  EXPECT_GT(shaded, 500);
  EXPECT_GT(open, 5000);
  EXPECT_GT(own, 500);
}

TEST(RendererCachedShade, SunlightIsReflectedByWhereABodyStandsNow) {
  Plate world;
  world.scenario.bands = {{"3-5", 3.0, 5.0, {}}};
  Session run(world.scenario);
  const auto radiance = [&](double now_s) {
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = std::llround(now_s * 1e9);
    request.sensor_pose = world.eye;
    const int slot = run.renderer().submit(request);
    const auto& view = run.renderer().collect(static_cast<renderer::SlotIndex>(slot));
    std::vector<float> out(view.radiance_w_m2_sr[0].begin(), view.radiance_w_m2_sr[0].end());
    run.renderer().release(static_cast<renderer::SlotIndex>(slot));
    return out;
  };
  constexpr double kSpeedMs = 20.0;
  std::vector<float> before;
  for (double now_s = Plate::kFromS; now_s < 7250.0; now_s += 0.05) {
    const double east_m = 60.0 - kSpeedMs * (now_s - Plate::kFromS);
    tell(run, now_s, world.at(east_m));
    const auto frame = radiance(now_s);
    if (before.empty()) before = frame;
    if (std::abs(east_m) > 0.6) continue;
    std::vector<float> lost;
    for (std::size_t i = 0; i < frame.size(); ++i) {
      const glm::dvec3 point_m = world.ground_at(i);
      if (world.hidden(point_m, east_m) || world.inside_m(point_m, east_m, now_s) < 0.3) continue;
      lost.push_back(before[i] - frame[i]);
    }
    ASSERT_GT(lost.size(), 200U);
    std::ranges::nth_element(lost, lost.begin() + static_cast<std::ptrdiff_t>(lost.size() / 2));
    const float whole = lost[lost.size() / 2];
    ASSERT_GT(whole, 0.05F);
    for (std::size_t i = 0; i < frame.size(); ++i) {
      const glm::dvec3 point_m = world.ground_at(i);
      const double inside_m = world.inside_m(point_m, east_m, now_s);
      if (world.hidden(point_m, east_m) || std::abs(inside_m) < 0.3) continue;
      EXPECT_NEAR(before[i] - frame[i], inside_m > 0.0 ? whole : 0.0F, 0.1F * whole)
          << now_s << " s, " << point_m.x << ' ' << point_m.y << ", inside " << inside_m;
    }
  }
}

}  // namespace
}  // namespace emit::test
