// SPDX-License-Identifier: Apache-2.0
// Cases in which thermal samples on surfaces could go wrong: instances that share a mesh, entities
// that move, the change from one interval to the next, and ground under entities.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/simplify.hpp"
#include "support/cached_session.hpp"
#include "support/renderer_scene.hpp"

namespace emit::test {
namespace {

TEST(RendererCachedBreaks, InstancesOfOneMeshHaveTheirOwnTemperatures) {
  // Set up two plates, one of them in the shade of a wall. They share a mesh when they are a few
  // pixels wide, and have a mesh each when they are wider.
  const auto plate = write_quads("plate", {ground(1.0, 1.0)});
  const auto wall = write_quads("wall", box({2.0, -8.0, 0.0}, {3.0, 8.0, 4.0}));
  const glm::dvec3 open_m(-12.0, 0.0, 0.0);
  const glm::dvec3 middle_m(-6.0, 0.0, 0.0);
  const auto pose = looking(middle_m + glm::dvec3(-25.0, 0.0, 40.0), middle_m);
  const auto plates = [&](bool both, std::uint32_t fineness) {
    auto scenario = cached_scenario(plate);
    scene::ObjectDesc screen = scenario.objects.front();
    screen.name = "wall";
    screen.gltf = wall;
    scene::ObjectDesc& object = scenario.objects.front();
    const physics::Pose shaded = object.instances.front();
    object.instances.front().position_world_m = open_m;
    if (both) object.instances.push_back(shaded);
    scenario.objects.push_back(screen);
    scenario.sensor.trajectory = {{0, pose}};
    scenario.sensor.width_px *= fineness;
    scenario.sensor.height_px *= fineness;
    return scenario;
  };
  for (const std::uint32_t fineness : {1U, 4U}) {
    const auto scenario = plates(true, fineness);
    auto geometry = scene::load_scene(scenario);
    ASSERT_TRUE(geometry.has_value());
    const scene::DetailView view{
        {&pose.position_world_m, 1},
        2.0 * std::tan(0.5 * scenario.sensor.fov_h_rad) / scenario.sensor.width_px};
    const auto drawn = scene::separated(std::move(*geometry), view);
    ASSERT_EQ(drawn.instances[0].mesh == drawn.instances[1].mesh, fineness == 1);
    const auto frame = [&](bool both) {
      Session session(plates(both, fineness), {.object = true});
      auto picture = session.frame_k(2 * kHourNs, pose);
      return std::pair(std::move(picture), session.objects());
    };
    const auto [both_k, both_objects] = frame(true);
    const auto [alone_k, alone_objects] = frame(false);
    std::vector<float> shaded_k;
    std::vector<float> open_k;
    for (std::size_t i = 0; i < both_k.size(); ++i) {
      if (both_objects[i] != 1.0F) continue;
      if (alone_objects[i] == 1.0F) {
        EXPECT_NEAR(both_k[i], alone_k[i], 0.1F) << i;
        open_k.push_back(both_k[i]);
      } else {
        shaded_k.push_back(both_k[i]);
      }
    }
    ASSERT_GT(open_k.size(), 10U);
    ASSERT_GT(shaded_k.size(), 10U);
    EXPECT_LT(std::ranges::max(shaded_k), std::ranges::min(open_k) - 8.0F);
  }
}

TEST(RendererCachedBreaks, ShadeOfAPassingBodyIsItsMeanOverTheInterval) {
  // Let a plate fly over at constant speed. A point lies in its shade for 8 s of an interval of 20
  // s.
  constexpr double kHalfLengthM = 4.0;
  constexpr double kHeightM = 10.0;
  constexpr double kSpeedMs = 1.0;
  constexpr double kOverOriginS = 7270.0;  // time at which the centre of its shade is at the origin
  constexpr double kFromS = 7215.0;
  constexpr double kToS = 7325.0;
  auto scenario = cached_scenario(write_quads("ground", fine_ground(16.0, 0.5)));
  scene::ObjectDesc plate = scenario.objects.front();
  plate.name = "plate";
  plate.gltf = write_quads("plate", {ground(kHalfLengthM, 2.0)});
  plate.entity_id = 7;
  const glm::dvec3 sun = to_sun(scenario, kOverOriginS);
  const auto at = [&](double seconds) {
    physics::Pose pose = plate.instances.front();
    pose.position_world_m = kHeightM / sun.z * sun;
    pose.position_world_m.x += kSpeedMs * (seconds - kOverOriginS);
    return pose;
  };
  plate.trajectory = {{std::llround(kFromS * 1e9), at(kFromS)},
                      {std::llround(kToS * 1e9), at(kToS)}};
  plate.instances = {at(kFromS)};
  scenario.objects.push_back(plate);
  constexpr double kEyeM = 28.0;
  const auto pose = looking({0.0, -0.001, kEyeM}, {0.0, 0.0, 0.0});
  const double px_m = 2.0 * kEyeM * std::tan(0.5 * scenario.sensor.fov_h_rad) / kWidth;
  const auto check = [&](const std::vector<float>& frame, double seconds) {
    const std::int64_t now_ns = std::llround(seconds * 1e9);
    const double open_k = open_ground_k(scenario, now_ns);
    EXPECT_NEAR(frame[kWidth / 2], open_k, 0.02);
    const float* track_k = &frame[std::size_t{kHeight} / 2 * kWidth];
    for (std::uint32_t column = 0; column < kWidth; ++column) {
      const float before_k = track_k[column == 0 ? 0 : column - 1];
      EXPECT_NEAR(track_k[column], before_k, 0.1) << seconds << " s, column " << column;
      if (column % 12 != 0) continue;
      const double x_m = (column + 0.5 - 0.5 * kWidth) * px_m;
      const double middle_s = kOverOriginS + x_m / kSpeedMs;
      constexpr double kHalfS = kHalfLengthM / kSpeedMs;
      const double expected_k =
          open_ground_k(scenario, now_ns, Shade{middle_s - kHalfS, middle_s + kHalfS});
      EXPECT_NEAR(track_k[column], expected_k, 0.06) << seconds << " s, " << x_m << " m";
      EXPECT_LT(track_k[column], open_k - 0.15) << seconds << " s, " << x_m << " m";
    }
  };
  {
    Session run(scenario);
    std::vector<float> frame;
    for (std::int64_t seconds = 7205; seconds <= 7305; seconds += 10) {
      frame = run.frame_k(seconds * kSecondNs, pose);
    }
    check(frame, 7305.0);
  }
  // Check a run whose warm-up integrates the passage as part of the history.
  check(Session(scenario).frame_k(7325 * kSecondNs, pose), 7325.0);
}

/// Change of each pixel from one frame to the next, K.
std::vector<double> changes_k(const std::vector<float>& before, const std::vector<float>& after) {
  std::vector<double> out(before.size(), 0.0);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double k = static_cast<double>(after[i]) - static_cast<double>(before[i]);
    if (!std::isnan(k)) out[i] = std::abs(k);
  }
  return out;
}

void keep_most(std::vector<double>& most, const std::vector<double>& values) {
  most.resize(values.size(), 0.0);
  for (std::size_t i = 0; i < most.size(); ++i) most[i] = std::max(most[i], values[i]);
}

TEST(RendererCachedBreaks, ClosingTheNewestIntervalShowsInNoPixel) {
  const auto scenario = cached_scenario(box_on_ground());
  const auto pose = looking({-6.0, -9.0, 7.0}, {-1.0, 0.0, 0.0});
  constexpr std::int64_t kStepNs = kSecondNs / 4;
  Session run(scenario);
  std::int64_t now_ns = 2 * kHourNs + kStepNs / 2;
  const auto first = run.frame_k(now_ns, pose);
  auto last = first;
  std::vector<std::vector<double>> by_pixel_k(first.size());
  for (int f = 0; f < 340; ++f) {
    now_ns += kStepNs;
    auto frame = run.frame_k(now_ns, pose);
    const auto changed_k = changes_k(last, frame);
    for (std::size_t i = 0; i < changed_k.size(); ++i) by_pixel_k[i].push_back(changed_k[i]);
    last = std::move(frame);
  }
  ASSERT_GT(now_ns, 2 * kHourNs + 4 * std::llround(scenario.thermal.first_step_s * 1e9));
  double most_k = 0.0;
  for (auto& changed_k : by_pixel_k) {
    std::ranges::sort(changed_k);
    const double usual_k = changed_k[changed_k.size() * 9 / 10];
    most_k = std::max(most_k, changed_k[changed_k.size() - 1] - usual_k);
  }
  EXPECT_LT(most_k, 0.25 * scenario.thermal.tolerance_k);
  // Expect that the test could see a fault: an edge of the shadow moved.
  EXPECT_GT(std::ranges::max(changes_k(first, last)), 10.0 * scenario.thermal.tolerance_k);
}

TEST(RendererCachedBreaks, AnEventShowsNowhereButWhereItActs) {
  // Let the host take a vehicle away in the middle of an interval, which is then computed anew.
  auto scenario = cached_scenario(box_on_ground());
  scene::ObjectDesc vehicle = scenario.objects.front();
  vehicle.name = "vehicle";
  vehicle.gltf = write_quads("vehicle", box({-1.0, -1.0, 0.2}, {1.0, 1.0, 1.5}));
  vehicle.entity_id = 7;
  vehicle.instances.front().position_world_m = {7.0, 0.0, 0.0};
  scenario.objects.push_back(vehicle);
  const auto pose = looking({1.5, -0.01, 24.0}, {1.5, 0.0, 0.0});
  constexpr std::int64_t kStepNs = kSecondNs / 4;
  constexpr int kEvent = 42;
  for (const bool vanishes : {false, true}) {
    Session run(scenario, {.object = true});
    std::int64_t now_ns = 2 * kHourNs + kStepNs / 2;
    auto last = run.frame_k(now_ns, pose);
    const auto shown = run.objects();
    std::vector<double> event_k;
    std::vector<double> before_k;
    for (int f = 1; f <= kEvent; ++f) {
      now_ns += kStepNs;
      if (f == kEvent) {
        renderer::EntityUpdate update{7, vehicle.instances.front(), !vanishes, true};
        if (!vanishes) update.pose.position_world_m.x += 300.0;
        EXPECT_EQ(run.renderer().apply_entities(now_ns, {&update, 1}), 1U);
      }
      auto frame = run.frame_k(now_ns, pose);
      keep_most(f == kEvent ? event_k : before_k, changes_k(last, frame));
      last = std::move(frame);
    }
    // Expect that the event itself changes no temperature: neither of the ground that is uncovered
    // nor of the western half of the image, which the event does not concern and where another
    // shadow has its edge.
    double bared_k = 0.0;
    double aside_k = 0.0;
    for (std::size_t i = 0; i < event_k.size(); ++i) {
      if (shown[i] != run.objects()[i]) continue;
      double& most_k = i % kWidth < kWidth / 2 ? aside_k : bared_k;
      most_k = std::max(most_k, event_k[i] - before_k[i]);
    }
    EXPECT_LT(aside_k, 0.25 * scenario.thermal.tolerance_k);
    EXPECT_LT(bared_k, 0.25 * scenario.thermal.tolerance_k);
    // Expect that the sun heats the uncovered ground from then on, as in the model.
    const std::int64_t later_ns = now_ns + 30 * kSecondNs;
    auto frame = last;
    while (now_ns < later_ns) frame = run.frame_k(now_ns += kStepNs, pose);
    const Shade rest{static_cast<double>(later_ns - 30 * kSecondNs) * 1e-9,
                     static_cast<double>(later_ns) * 1e-9};
    const double gain_k =
        open_ground_k(scenario, later_ns) - open_ground_k(scenario, later_ns, rest);
    double most_k = 0.0;
    for (std::size_t i = 0; i < frame.size(); ++i) {
      if (shown[i] != run.objects()[i] || i % kWidth < kWidth / 2) continue;
      most_k = std::max(most_k, static_cast<double>(frame[i]) - static_cast<double>(last[i]));
    }
    EXPECT_NEAR(most_k, gain_k, 0.15 * gain_k);
  }
}

TEST(RendererCachedBreaks, WhatHappensInAHoldWaitsForTheClock) {
  const auto scenario = parking_lot(20 * kHourNs);
  const auto pose = looking({0.0, -0.01, 16.0}, {0.0, 0.0, 0.0});
  const std::int64_t held_ns = 2 * kHourNs + 10 * kSecondNs;
  Session run(scenario);
  const auto before = run.frame_k(held_ns, pose);
  const renderer::EntityUpdate gone{7, scenario.objects[1].instances.front(), false, false};
  EXPECT_EQ(run.renderer().apply_entities(held_ns + 5 * kSecondNs, {&gone, 1}), 1U);
  // Expect that nothing changes and nothing is sampled anew while the thermal clock stands.
  const auto samples = run.renderer().scene_stats().samples;
  for (int i = 0; i < 3; ++i) {
    EXPECT_LT(difference(before, run.frame_k(held_ns, pose)).max_k, 0.025) << i;
  }
  EXPECT_EQ(run.renderer().scene_stats().samples, samples);
  const auto after = run.frame_k(held_ns + 25 * kSecondNs, pose);
  EXPECT_GT(difference(before, after).max_k, 0.2);
}

TEST(RendererCachedBreaks, AScriptedEventActsFromItsInstantOn) {
  // Put the event into the middle of an interval of 20 s.
  const std::int64_t leaves_ns = 2 * kHourNs + 30 * kSecondNs;
  const auto pose = looking({0.0, -0.01, 16.0}, {0.0, 0.0, 0.0});
  const auto frames = [&](std::int64_t at_ns) {
    Session run(parking_lot(at_ns));
    std::vector<std::vector<float>> out;
    for (const double seconds : {-29.0, -6.0, -0.1, 8.0}) {
      out.push_back(run.frame_k(leaves_ns + std::llround(seconds * 1e9), pose));
    }
    return out;
  };
  const auto left = frames(leaves_ns);
  const auto stayed = frames(leaves_ns + kHourNs);
  for (std::size_t i = 0; i < 3; ++i) {
    // Allow for the rays, which differ between intervals of different length.
    EXPECT_LT(difference(left[i], stayed[i]).max_k, 0.025) << i;
  }
  EXPECT_GT(difference(left[3], stayed[3]).max_k, 0.2);
}

/// Cosine-weighted share of a level point's hemisphere that a level square centred above it takes.
double square_above_frac(double half_m, double up_m) {
  const double x = half_m / up_m;
  const double root = std::sqrt(1.0 + x * x);
  return 4.0 / physics::kPi * x / root * std::atan(x / root);
}

TEST(RendererCachedBreaks, GroundUnderAParkedBodySeesItsUnderside) {
  // Use a clear night. The vehicle arrives at sunset, when the history starts.
  constexpr double kHalfM = 2.5;
  constexpr double kUpM = 0.4;
  const std::int64_t now_ns = 20 * kHourNs;
  const auto parked = [&](std::uint32_t entity_id, std::optional<double> hull_k) {
    auto scenario = cached_scenario(write_quads("lot", {ground(14.0, 14.0)}));
    scenario.thermal.history_start_ns = 13 * kHourNs;
    scene::ObjectDesc vehicle = scenario.objects.front();
    vehicle.name = "vehicle";
    auto quads = box({-kHalfM, -kHalfM, kUpM}, {kHalfM, kHalfM, 2.0});
    quads.push_back({{-kHalfM, -kHalfM, kUpM},
                     {-kHalfM, kHalfM, kUpM},
                     {kHalfM, kHalfM, kUpM},
                     {kHalfM, -kHalfM, kUpM}});
    vehicle.gltf = write_quads("vehicle", quads);
    vehicle.entity_id = entity_id;
    if (hull_k) {
      scenario.materials.push_back(scenario.materials.front());
      scenario.materials.back().name = vehicle.material = "hull";
      scenario.materials.back().prescribed_k = hull_k;
    }
    scenario.objects.push_back(vehicle);
    return scenario;
  };
  const auto under_k = [&](const scene::ScenarioDesc& scenario) {
    Session run(scenario, {.object = true});
    const auto frame = run.frame_k(now_ns, looking({0.0, -6.0, 0.3}, {0.0, 0.0, 0.0}));
    constexpr std::size_t kMiddle = kHeight / 2 * kWidth + kWidth / 2;
    EXPECT_EQ(run.objects()[kMiddle], 1.0F);
    return static_cast<double>(frame[kMiddle]);
  };
  const double open_k = open_ground_k(parked(0, std::nullopt), now_ns);
  // Expect that the vehicle hides the sky, whether it is static or an entity.
  EXPECT_GT(under_k(parked(0, std::nullopt)), open_k + 2.0);
  EXPECT_GT(under_k(parked(7, std::nullopt)), open_k + 2.0);
  // Expect that the ground receives the radiation of the underside in both cases.
  for (const auto& [entity_id, hull_k] :
       {std::pair(0U, 280.0), {0U, 330.0}, {7U, 280.0}, {7U, 330.0}}) {
    const auto scenario = parked(entity_id, hull_k);
    const double found_k = under_k(scenario);
    const double eps = scenario.materials[0].emissivity_frac;
    const double hull_w_m2 =
        physics::kStefanBoltzmannWPerM2K4 *
        (eps * std::pow(hull_k, 4) + (1.0 - eps) * (eps * std::pow(found_k, 4)));
    const double covered_frac = square_above_frac(kHalfM, kUpM);
    const double expected_k =
        open_ground_k(scenario, now_ns, {}, [&](renderer::SurfaceForcing& forcing) {
          forcing.longwave_w_m2 =
              covered_frac * hull_w_m2 + (1.0 - covered_frac) * forcing.longwave_w_m2;
          forcing.diffuse_w_m2 *= 1.0 - covered_frac;
        });
    EXPECT_NEAR(found_k, expected_k, entity_id == 0 ? 0.3 : 0.6) << entity_id << ' ' << hull_k;
  }
}

/// Expects ground as warm as open ground at the sunlit foot of a box of 2 m. Its faces may be
/// double-sided, as many exporters write them.
void expect_sunlit_foot(bool double_sided) {
  // Put a box on ground of two triangles. The covered ground never saw the sun of this morning.
  auto scenario = cached_scenario(write_quads("lot", {ground(14.0, 14.0)}));
  scene::ObjectDesc body = scenario.objects.front();
  body.name = "body";
  body.gltf = write_quads("body", box({-1.0, -1.0, 0.0}, {1.0, 1.0, 2.0}), double_sided);
  scenario.objects.push_back(body);
  const std::int64_t now_ns = 4 * kHourNs;
  const auto pose = looking({3.5, -0.4, 1.6}, {1.2, 0.0, 0.0});  // in front of its sunlit side
  Session run(scenario, {.object = true});
  const auto frame = run.frame_k(now_ns, pose);
  const auto& objects = run.objects();
  const double open_k = open_ground_k(scenario, now_ns);
  // Leave out the right of the image, where its shadow lies.
  int ground_px = 0;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    if (objects[i] != 1.0F || i % kWidth >= kWidth * 6 / 10) continue;
    ++ground_px;
    EXPECT_GT(frame[i], open_k - 0.5) << i % kWidth << ' ' << i / kWidth;
    EXPECT_LT(frame[i], open_k + 5.0) << i % kWidth << ' ' << i / kWidth;
  }
  EXPECT_GT(ground_px, 2000);
}

TEST(RendererCachedBreaks, CoveredGroundIsNotMixedIntoWhatLiesBeforeTheFoot) {
  for (const bool double_sided : {false, true}) expect_sunlit_foot(double_sided);
}

TEST(RendererCachedBreaks, MoreMaterialsThanAPixelCanNameAreRefused) {
  constexpr std::size_t kMaterials = 4097;
  const auto file = write_quads("many", {ground(1.0, 1.0)});
  std::ifstream in(file);
  std::string text((std::istreambuf_iterator<char>(in)), {});
  auto scenario = instant_scenario(file);
  const scene::Material material = scenario.materials.front();
  std::string materials = R"({"name":"surface"})";
  const std::string mesh = R"({"primitives":[{"attributes":{"POSITION":0},"material":0}]})";
  const auto replace = [&text](const std::string& from, const std::string& to) {
    ASSERT_NE(text.find(from), std::string::npos);
    text.replace(text.find(from), from.size(), to);
  };
  std::string more_materials = materials;
  // Every material has a floor of its own: surfaces that cover each other are cut.
  std::string more_meshes = mesh;
  std::string more_nodes = R"({"mesh":0})";
  std::string more_roots = "0";
  for (std::size_t i = 1; i < kMaterials; ++i) {
    const std::string number = std::to_string(i);
    more_materials += R"(,{"name":"m)" + number + R"("})";
    more_meshes += R"(,{"primitives":[{"attributes":{"POSITION":0},"material":)" + number + "}]}";
    more_nodes += R"(,{"translation":[0,)" + number + R"(,0],"mesh":)" + number + "}";
    more_roots += "," + number;
    scenario.materials.push_back(material);
    scenario.materials.back().name = "m" + number;
  }
  replace(materials, more_materials);
  replace(mesh, more_meshes);
  replace(R"("nodes":[{"mesh":0}])", R"("nodes":[)" + more_nodes + "]");
  replace(R"("nodes":[0])", R"("nodes":[)" + more_roots + "]");
  std::ofstream(file) << text;
  const auto made = renderer::Renderer::create(scenario, {}, {});
  ASSERT_FALSE(made.has_value());
  EXPECT_EQ(made.error().code, physics::ErrorCode::config);
  EXPECT_NE(made.error().text.find("4097"), std::string::npos) << made.error().text;
  EXPECT_NE(made.error().text.find("4096"), std::string::npos) << made.error().text;
}

}  // namespace
}  // namespace emit::test
