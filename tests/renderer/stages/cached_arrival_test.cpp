// SPDX-License-Identifier: Apache-2.0
// Bodies that come and go: each exchanges radiation with what stands there now. A run in which they
// move is compared with one that starts with everything in its last place.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>
#include <vector>

#include "support/cached_session.hpp"

namespace emit::test {
namespace {

using PartKind = scene::PartCommand::Kind;

constexpr double kAirTemperatureK = 290.0;
constexpr double kHotBodyK = 420.0;
constexpr std::int64_t kMoveNs = 2 * kHourNs;
constexpr std::int64_t kShownNs = kMoveNs + 1800 * kSecondNs;
constexpr glm::dvec3 kFarAway{0.0, 300.0, 0.0};

/// Open ground at night under a cold sky. All surfaces follow within minutes.
scene::ScenarioDesc night() {
  scene::ScenarioDesc s = cached_scenario(write_quads("night", {ground(30.0, 30.0)}));
  scene::WeatherSample air = weather(0.0, 0.0, 280.0, kAirTemperatureK);
  air.film_w_m2_k = 8.0;
  s.weather = {air};
  scene::Material& skin = s.materials[0];
  skin.base_k = kAirTemperatureK;
  skin.layers = {{0.001, 200.0, 2700, 900}, {0.2, 0.03, 20, 1000}};
  skin.emissivity_frac = 0.9;
  skin.modes.clear();
  return s;
}

/// Adds a box of 2 m x 2 m x 1.6 m with its middle over a place. With a temperature its skin is
/// held at it.
void add_box(scene::ScenarioDesc& s, std::uint32_t id, double held_k = 0.0) {
  const std::string name = "box" + std::to_string(id);
  scene::ObjectDesc body = s.objects.front();
  body.name = name;
  body.gltf = write_quads(name, box({-1.0, -1.0, 0.2}, {1.0, 1.0, 1.8}));
  body.entity_id = id;
  if (held_k > 0.0) {
    scene::Material hot = s.materials[0];
    hot.name = name;
    s.materials.push_back(hot);
    body.material = name;
    body.parts = {{1, "hull", name, {}, {{0, {PartKind::temperature, held_k}}}}};
  }
  s.objects.push_back(body);
}

physics::Pose stands_at(const scene::ScenarioDesc& s, const glm::dvec3& at_m) {
  physics::Pose pose = s.objects.front().instances.front();
  pose.position_world_m = at_m;
  return pose;
}

/// Lets the newest object stand at a place until it jumps to another one.
void jumps(scene::ScenarioDesc& s, const glm::dvec3& from_m, const glm::dvec3& to_m) {
  scene::ObjectDesc& body = s.objects.back();
  body.instances = {stands_at(s, from_m)};
  body.trajectory = {{0, stands_at(s, from_m), true, false},
                     {kMoveNs, stands_at(s, from_m), true, false},
                     {kMoveNs + kSecondNs / 10, stands_at(s, to_m), true, true}};
}
void stays(scene::ScenarioDesc& s, const glm::dvec3& at_m) {
  s.objects.back().instances = {stands_at(s, at_m)};
}

/// Mean temperature of the pixels in the middle of an image from a place at the end of the time,
/// after frames from an instant on.
double seen_k(const scene::ScenarioDesc& s, const glm::dvec3& from_m, const glm::dvec3& at_m,
              std::int64_t from_ns = kMoveNs - kSecondNs) {
  Session run(s);
  const physics::Pose eye = looking(from_m, at_m);
  std::vector<float> frame;
  for (std::int64_t now_ns = from_ns; now_ns < kShownNs; now_ns += 15 * kSecondNs) {
    frame = run.frame_k(now_ns, eye);
  }
  double sum_k = 0.0;
  int count = 0;
  for (std::uint32_t y = kHeight / 2 - 6; y < kHeight / 2 + 6; ++y) {
    for (std::uint32_t x = kWidth / 2 - 6; x < kWidth / 2 + 6; ++x) {
      sum_k += static_cast<double>(frame[y * kWidth + x]);
      ++count;
    }
  }
  return sum_k / count;
}

constexpr glm::dvec3 kEast{1.0, 0.0, 1.0};    ///< middle of the east side of a box at the origin
constexpr glm::dvec3 kBeside{4.0, 0.0, 0.0};  ///< place of a box 2 m east of it
double east_side_k(const scene::ScenarioDesc& s) {
  return seen_k(s, kEast + glm::dvec3(0.7, 0.05, 0.3), kEast);
}

TEST(RendererCachedArrival, ABodyThatComesToAHotWallIsWarmedByIt) {
  const auto world = [] {
    // Stand a wall of 6 m x 4 m at x = 2.5 m, which looks west.
    scene::ScenarioDesc s = night();
    scene::Material hot = s.materials[0];
    hot.name = "wall";
    hot.prescribed_k = kHotBodyK;
    s.materials.push_back(hot);
    scene::ObjectDesc wall = s.objects.front();
    wall.name = wall.material = "wall";
    wall.gltf = write_quads(
        "wall", {{{2.5, 3.0, 0.0}, {2.5, -3.0, 0.0}, {2.5, -3.0, 4.0}, {2.5, 3.0, 4.0}}});
    s.objects.push_back(wall);
    return s;
  };
  scene::ScenarioDesc s = world();
  add_box(s, 7);
  jumps(s, kFarAway, {0.0, 0.0, 0.0});
  scene::ScenarioDesc fresh = world();
  add_box(fresh, 7);
  stays(fresh, {0.0, 0.0, 0.0});
  scene::ScenarioDesc alone = world();
  add_box(alone, 7);
  stays(alone, kFarAway);
  const double came_k = east_side_k(s);
  const double stood_k = east_side_k(fresh);
  const double cold_k =
      seen_k(alone, kFarAway + kEast + glm::dvec3(0.7, 0.05, 0.3), kFarAway + kEast);
  EXPECT_GT(stood_k, cold_k + 5.0);
  EXPECT_NEAR(came_k, stood_k, 0.03 * (stood_k - cold_k));
}

TEST(RendererCachedArrival, AHotWallInManyPiecesWarmsTheGroundAsOneInOnePieceDoes) {
  // A surface sees each piece of a prescribed temperature apart, far more faces than by rays.
  const auto beside_wall_k = [](int pieces) {
    scene::ScenarioDesc s = night();
    scene::Material hot = s.materials[0];
    hot.name = "wall";
    hot.prescribed_k = kHotBodyK;
    s.materials.push_back(hot);
    std::vector<Quad> quads;
    const double width_m = 6.0 / pieces;
    constexpr double kGapM = 1e-4;  // so that the pieces share no corners
    for (int i = 0; i < pieces; ++i) {
      const double south_m = -3.0 + i * width_m;
      const double north_m = south_m + width_m - kGapM;
      quads.push_back(
          {{2.5, north_m, 0.0}, {2.5, south_m, 0.0}, {2.5, south_m, 4.0}, {2.5, north_m, 4.0}});
    }
    scene::ObjectDesc wall = s.objects.front();
    wall.name = wall.material = "wall";
    wall.gltf = write_quads("wall" + std::to_string(pieces), quads);
    s.objects.push_back(wall);
    return seen_k(s, {-0.5, 0.0, 2.0}, {0.5, 0.0, 0.0});
  };
  EXPECT_NEAR(beside_wall_k(30), beside_wall_k(1), 0.1);
}

TEST(RendererCachedArrival, AHotPartOfAnEntityWarmsTheGroundAsSceneryDoes) {
  // A plate of 1 m x 1 m at 800 K hangs 1.5 m over the ground, in one piece or in many.
  const auto ground_k = [](bool entity, int pieces, double away_m, std::int64_t live_s = 1) {
    scene::ScenarioDesc s = night();
    scene::Material hot = s.materials[0];
    hot.name = "plate";
    hot.prescribed_k = 800.0;
    s.materials.push_back(hot);
    std::vector<Quad> quads;
    const double side_m = 1.0 / pieces;
    for (int i = 0; i < pieces * pieces; ++i) {
      const double x = -0.5 + side_m * (i % pieces);
      const double y = -0.5 + side_m * (i / pieces);
      quads.push_back(
          {{x, y, 1.5}, {x, y + side_m, 1.5}, {x + side_m, y + side_m, 1.5}, {x + side_m, y, 1.5}});
    }
    scene::ObjectDesc plate = s.objects.front();
    plate.name = plate.material = "plate";
    plate.gltf = write_quads("plate" + std::to_string(pieces), quads);
    if (entity) {
      plate.entity_id = 7;
      plate.instances = {stands_at(s, {0.0, 0.0, 0.0})};
    }
    s.objects.push_back(plate);
    return seen_k(s, {away_m - 1.0, -1.5, 1.0}, {away_m, 0.02, 0.0}, kShownNs - live_s * kSecondNs);
  };
  const double cold_k = ground_k(false, 1, 28.0);
  for (const double away_m : {0.05, 1.2, 3.0, 5.0, 7.0}) {
    SCOPED_TRACE(away_m);
    const double scenery_k = ground_k(false, 1, away_m);
    EXPECT_GT(scenery_k, cold_k + (away_m < 4.0 ? 1.0 : 0.05));
    EXPECT_NEAR(ground_k(true, 1, away_m), scenery_k, 0.1 + 0.03 * (scenery_k - cold_k));
    EXPECT_NEAR(ground_k(true, 9, away_m), scenery_k, 0.1 + 0.03 * (scenery_k - cold_k));
  }
  // Live steps carry on what the warm-up began.
  constexpr double kAwayM = 1.2;
  const double warm_k = ground_k(false, 1, kAwayM);
  EXPECT_NEAR(ground_k(true, 1, kAwayM, 1200), warm_k, 0.1 + 0.03 * (warm_k - cold_k));
}

TEST(RendererCachedArrival, WideTrianglesFindAHotPartBetweenTheirCorners) {
  // Two triangles of 60 m are the ground, and a plate at 800 K hangs over one of them. By night
  // nothing else is a reason to halve them.
  const auto ground_k = [](double tolerance_k, const glm::dvec3& plate_m, const glm::dvec3& at_m) {
    scene::ScenarioDesc s = night();
    s.thermal.tolerance_k = tolerance_k;
    scene::Material hot = s.materials[0];
    hot.name = "plate";
    hot.prescribed_k = 800.0;
    s.materials.push_back(hot);
    scene::ObjectDesc plate = s.objects.front();
    plate.name = plate.material = "plate";
    plate.gltf = write_quads(
        "plate_down", {{{-0.5, -0.5, 1.5}, {-0.5, 0.5, 1.5}, {0.5, 0.5, 1.5}, {0.5, -0.5, 1.5}}});
    plate.entity_id = 7;
    s.objects.push_back(plate);
    stays(s, plate_m);
    Session run(s);
    (void)run.frame_k(kShownNs, looking(at_m + glm::dvec3(-40.0, -60.0, 40.0), at_m));
    const auto sample = run.renderer().nearest_sample({at_m, glm::dvec3(0.0, 0.0, 1.0)});
    EXPECT_TRUE(sample.has_value());
    return sample ? run.renderer().sample_reading(*sample).temperature_k : 0.0;
  };
  for (const glm::dvec3& plate_m : {glm::dvec3(9.3, -7.7, 0.0), glm::dvec3(-4.1, 12.9, 0.0),
                                    glm::dvec3(17.7, 3.2, 0.0), glm::dvec3(-13.4, -9.6, 0.0)}) {
    SCOPED_TRACE(plate_m.x);
    const double cold_k = ground_k(2.0, {-27.0, 27.0, 0.0}, plate_m);
    const double fine_k = ground_k(0.2, plate_m, plate_m);
    const double coarse_k = ground_k(2.0, plate_m, plate_m);
    std::printf("cold %.2f K, fine %.2f K, coarse %.2f K\n", cold_k, fine_k, coarse_k);
    EXPECT_GT(fine_k, cold_k + 20.0);
    EXPECT_NEAR(coarse_k, fine_k, 0.15 * (fine_k - cold_k));
  }
}

TEST(RendererCachedArrival, AHotBodyThatComesWarmsOneThatStandsThere) {
  scene::ScenarioDesc s = night();
  add_box(s, 7);
  stays(s, {0.0, 0.0, 0.0});
  add_box(s, 8, kHotBodyK);
  jumps(s, kFarAway, kBeside);
  scene::ScenarioDesc fresh = night();
  add_box(fresh, 7);
  stays(fresh, {0.0, 0.0, 0.0});
  add_box(fresh, 8, kHotBodyK);
  stays(fresh, kBeside);
  scene::ScenarioDesc before = night();
  add_box(before, 7);
  stays(before, {0.0, 0.0, 0.0});
  const double came_k = east_side_k(s);
  const double stood_k = east_side_k(fresh);
  const double cold_k = east_side_k(before);
  EXPECT_GT(stood_k, cold_k + 5.0);
  EXPECT_NEAR(came_k, stood_k, 0.1 * (stood_k - cold_k));
}

TEST(RendererCachedArrival, AHotBodyThatLeavesNoLongerWarmsWhatItLeft) {
  scene::ScenarioDesc s = night();
  add_box(s, 7);
  stays(s, {0.0, 0.0, 0.0});
  add_box(s, 8, kHotBodyK);
  jumps(s, kBeside, kFarAway);
  scene::ScenarioDesc fresh = night();
  add_box(fresh, 7);
  stays(fresh, {0.0, 0.0, 0.0});
  const double left_k = east_side_k(s);
  const double cold_k = east_side_k(fresh);
  // The insulation behind the skin still remembers some tenths.
  EXPECT_NEAR(left_k, cold_k, 1.0);
}

TEST(RendererCachedArrival, TheGroundUnderABodyThatLeftForgetsIt) {
  scene::ScenarioDesc s = night();
  add_box(s, 8, kHotBodyK);
  jumps(s, {0.0, 0.0, 0.0}, kFarAway);
  const scene::ScenarioDesc fresh = night();
  const glm::dvec3 eye{0.3, 0.0, 3.0};
  EXPECT_NEAR(seen_k(s, eye, {0.3, 0.01, 0.0}), seen_k(fresh, eye, {0.3, 0.01, 0.0}), 0.3);
}

}  // namespace
}  // namespace emit::test
