// SPDX-License-Identifier: Apache-2.0
// The thermal method "cached" against the model in double precision, against "per-frame", and
// against itself: no frame may depend on where the camera was before.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "support/cached_session.hpp"
#include "support/renderer_scene.hpp"

namespace emit::test {
namespace {

TEST(RendererCached, OpenGroundFollowsTheModelInDoubleAlsoBetweenTheNodes) {
  const auto scenario = cached_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  Session run(scenario);
  const auto pose = looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0});
  for (const double seconds : {7200.0, 7203.0, 7211.0, 7239.5, 7300.0}) {
    const auto now_ns = static_cast<std::int64_t>(seconds * 1e9);
    const double expected = open_ground_k(scenario, now_ns);
    for (const float t : run.frame_k(now_ns, pose)) ASSERT_NEAR(t, expected, 0.02) << seconds;
  }
}

TEST(RendererCached, MoistGroundFollowsTheModelInDoubleByDayAndNight) {
  auto scenario = cached_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  const double dry_k = open_ground_k(scenario, 7200 * kSecondNs);
  scenario.materials[0].surface_resistance_s_m = 70.0;
  scenario.materials[0].night_resistance_s_m = 200.0;
  Session run(scenario);
  const auto pose = looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0});
  EXPECT_LT(open_ground_k(scenario, 7200 * kSecondNs), dry_k - 2.0);
  for (const double seconds : {7200.0, 7203.0, 7239.5, 14'400.0}) {
    const auto now_ns = static_cast<std::int64_t>(seconds * 1e9);
    const double expected = open_ground_k(scenario, now_ns);
    for (const float t : run.frame_k(now_ns, pose)) ASSERT_NEAR(t, expected, 0.02) << seconds;
  }
}

/// Wind in which level faces have a film of about 15 W m-2 K-1. In weaker wind the sun warms them
/// more, and errors of the view grow with it.
constexpr double kBreezeMS = 4.0;

TEST(RendererCached, ShadowLiesWhereThePerFrameMethodPutsIt) {
  auto scenario = cached_scenario(box_on_ground());
  scenario.clear_sky.wind_m_s = kBreezeMS;
  const auto pose = looking({0.0, 0.1, 18.0}, {0.0, 0.0, 0.0});
  const auto cached = Session(scenario).frame_k(3 * kHourNs, pose);
  scenario.thermal.method = scene::ThermalMethod::per_frame;
  scenario.thermal.obscurance_radius_m = 1e-6;
  const auto per_frame = Session(scenario).frame_k(3 * kHourNs, pose);
  std::vector<double> errors;
  for (std::size_t i = 0; i < cached.size(); ++i) {
    errors.push_back(std::abs(static_cast<double>(cached[i]) - static_cast<double>(per_frame[i])));
  }
  std::ranges::sort(errors);
  // Compare shadow and open ground only. The box, the sky that it hides and edges differ between
  // the methods.
  EXPECT_LT(errors[errors.size() / 2], 0.05);
  EXPECT_LT(errors[errors.size() * 80 / 100], 0.4);
  const auto [low, high] = std::ranges::minmax(cached);
  EXPECT_GT(high - low, 8.0F);
}

TEST(RendererCached, ASmallBodyInALargeMeshCastsItsShade) {
  // Only rays between the corners of the ground's triangles can find the box.
  auto quads = box({6.8, 3.2, 0.0}, {7.4, 3.8, 1.0});
  quads.push_back(ground(60.0, 60.0));
  auto scenario = cached_scenario(write_quads("post", quads));
  const auto cool_px = [&](scene::ThermalMethod method) {
    scenario.thermal.method = method;
    const auto picture =
        Session(scenario).frame_k(3 * kHourNs, looking({7.0, -9.0, 9.0}, {6.0, 3.5, 0.0}));
    const float ground_k = picture[picture.size() - kWidth / 2];
    return std::ranges::count_if(picture, [&](float k) { return k < ground_k - 4.0F; });
  };
  const auto expected = cool_px(scene::ThermalMethod::per_frame);
  EXPECT_GT(expected, 30);
  EXPECT_NEAR(static_cast<double>(cool_px(scene::ThermalMethod::cached)),
              static_cast<double>(expected), 0.2 * static_cast<double>(expected));
}

TEST(RendererCached, ACameraThatTurnedAwayFindsWhatOneThatStayedSees) {
  const auto scenario = cached_scenario(box_on_ground());
  const auto pose = looking({3.0, -9.0, 6.0}, {0.0, 0.0, 0.0});
  const auto away = looking({3.0, -9.0, 6.0}, {3.0, -30.0, 6.0});
  const auto last = [&](bool turns) {
    Session session(scenario);
    std::vector<float> frame;
    for (std::int64_t i = 0; i <= 30; ++i) {
      const std::int64_t now_ns = 2 * kHourNs + i * 4 * kSecondNs;
      frame = session.frame_k(now_ns, turns && i > 3 && i < 30 ? away : pose);
    }
    return frame;
  };
  const auto stayed = last(false);
  EXPECT_LT(difference(stayed, last(true)).max_k, 1e-3);
}

TEST(RendererCached, RunningOnEndsWhereAFreshStartBegins) {
  const auto scenario = cached_scenario(box_on_ground());
  const auto pose = looking({3.0, -9.0, 6.0}, {0.0, 0.0, 0.0});
  const std::int64_t end_ns = 2 * kHourNs + 300 * kSecondNs;
  std::vector<float> last;
  {
    Session running(scenario);
    for (std::int64_t t = 2 * kHourNs; t <= end_ns; t += 3 * kSecondNs) {
      last = running.frame_k(t, pose);
    }
  }
  const Difference d = difference(last, Session(scenario).frame_k(end_ns, pose));
  EXPECT_LT(d.p99_k, 0.5);  // samples stay where the start refined them
  EXPECT_LT(d.max_k, 4.0);
}

TEST(RendererCached, TheSameFramesInLargerStepsGiveTheSameTemperatures) {
  const auto scenario = cached_scenario(box_on_ground());
  const auto pose = looking({3.0, -9.0, 6.0}, {0.0, 0.0, 0.0});
  const auto last = [&](std::int64_t frames) {
    Session session(scenario);
    std::vector<float> frame;
    for (std::int64_t i = 0; i <= frames; ++i) {
      frame = session.frame_k(2 * kHourNs + 200 * kSecondNs * i / frames, pose);
    }
    return frame;
  };
  const auto fine = last(40);
  EXPECT_EQ(difference(fine, last(1)).max_k, 0.0);
}

/// Box whose edges exchange heat along its faces, in the afternoon light that warms some of them.
scene::ScenarioDesc box_with_edges() {
  scene::ScenarioDesc scenario = cached_scenario(box_on_ground());
  scenario.thermal.lateral = true;
  return scenario;
}

TEST(RendererCached, HeatAtEdgesGoesOnAsAWarmUpHasIt) {
  const auto scenario = box_with_edges();
  // Half of the roof up to its rim: ground and walls, whose shadows move, stay out of the picture.
  const auto pose = looking({0.5, 0.0, 3.3}, {0.5, 0.001, 2.0});
  constexpr std::int64_t kEndNs = 5 * kHourNs;
  std::vector<float> last;
  {
    Session running(scenario);
    for (std::int64_t t = 2 * kHourNs; t <= kEndNs; t += 30 * kSecondNs) {
      last = running.frame_k(t, pose);
    }
  }
  const auto fresh = Session(scenario).frame_k(kEndNs, pose);
  auto without = scenario;
  without.thermal.lateral = false;
  const Difference heat = difference(fresh, Session(without).frame_k(kEndNs, pose));
  // The heat along the faces shows, and three hours of frames do not change what it does.
  EXPECT_GT(heat.p99_k, 1.0);
  EXPECT_LT(difference(last, fresh).p99_k, 0.1 * heat.p99_k);
}

TEST(RendererCached, HeatAtEdgesBeginsWithTheHistory) {
  auto scenario = box_with_edges();
  const auto pose = looking({0.5, 0.0, 3.3}, {0.5, 0.001, 2.0});
  // Before the history and at its start no time has passed in which heat could move.
  for (const std::int64_t now_ns : {-kHourNs, std::int64_t{0}, std::int64_t{1}, kSecondNs / 2}) {
    scenario.thermal.lateral = true;
    const auto with = Session(scenario).frame_k(now_ns, pose);
    scenario.thermal.lateral = false;
    const auto without = Session(scenario).frame_k(now_ns, pose);
    for (const float t : with) ASSERT_FALSE(std::isnan(t)) << now_ns;
    EXPECT_LT(difference(with, without).max_k, 0.05) << now_ns;
  }
}

TEST(RendererCached, HeatAtEdgesDoesNotDependOnTheFrames) {
  const auto scenario = box_with_edges();
  const auto pose = looking({2.2, -2.6, 3.2}, {0.0, 0.0, 1.2});
  const auto last = [&](std::int64_t frames) {
    Session session(scenario);
    std::vector<float> frame;
    for (std::int64_t i = 0; i <= frames; ++i) {
      frame = session.frame_k(2 * kHourNs + 400 * kSecondNs * i / frames, pose);
    }
    return frame;
  };
  const auto fine = last(133);
  EXPECT_EQ(difference(fine, last(7)).max_k, 0.0);
}

TEST(RendererCached, AVehicleThatLeftLeavesItsPrint) {
  const auto scenario = parking_lot(3 * kHourNs);
  Session run(scenario);
  const auto pose = looking({0.0, 0.1, 16.0}, {0.0, 0.0, 0.0});
  const std::int64_t shown_ns = 3 * kHourNs + 60 * kSecondNs;
  const auto frame = run.frame_k(shown_ns, pose);
  const double open_k = open_ground_k(scenario, shown_ns);
  const float middle_k = frame[kHeight / 2 * kWidth + kWidth / 2];
  EXPECT_LT(middle_k, open_k - 5.0);
  EXPECT_NEAR(frame[2 * kWidth + 2], open_k, 0.3);
}

TEST(RendererCached, AVehicleThatTheHostDrivesOffIsNotForgotten) {
  // Expect the same print from a scripted departure and from a live one at the same time.
  const auto scripted = parking_lot(2 * kHourNs + 30 * kSecondNs);
  auto live = scripted;
  live.objects[1].trajectory.resize(1);
  const auto pose = looking({0.0, 0.1, 16.0}, {0.0, 0.0, 0.0});
  const auto last = [&](const scene::ScenarioDesc& scenario, bool tell) {
    Session session(scenario);
    std::vector<float> frame;
    for (std::int64_t i = 0; i <= 30; ++i) {
      if (tell && (i == 6 || i == 7)) {
        const scene::Keyframe& key = scripted.objects[1].trajectory[i == 6 ? 1U : 2U];
        const renderer::EntityUpdate update{7, key.pose, true, key.teleport};
        EXPECT_EQ(session.renderer().apply_entities(key.sim_time_ns, {&update, 1}), 1U);
      }
      frame = session.frame_k(2 * kHourNs + i * 5 * kSecondNs, pose);
    }
    return frame;
  };
  const auto reference = last(scripted, false);
  EXPECT_LT(difference(reference, last(live, true)).p99_k, 0.5);
}

TEST(RendererCached, GoingBackStartsAfresh) {
  const auto scenario = cached_scenario(box_on_ground());
  const auto pose = looking({3.0, -9.0, 6.0}, {0.0, 0.0, 0.0});
  Session run(scenario);
  const auto first = run.frame_k(2 * kHourNs, pose);
  (void)run.frame_k(2 * kHourNs + 90 * kSecondNs, pose);
  run.renderer().reset();
  const auto before = run.frame_k(kHourNs, pose);
  EXPECT_GT(difference(first, before).p99_k, 1.0);
}

TEST(RendererCached, WarmUpReportsAndStops) {
  const auto scenario = cached_scenario(box_on_ground());
  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = kHourNs;
  request.sensor_pose = looking({3.0, -9.0, 6.0}, {0.0, 0.0, 0.0});
  int reports = 0;
  {
    Session run(scenario);
    EXPECT_FALSE(run.renderer().warm_up(request, [](double) { return false; }));
    double last_frac = 0.0;
    ASSERT_TRUE(run.renderer().warm_up(request, [&](double frac) {
      EXPECT_GE(frac, last_frac);
      last_frac = frac;
      ++reports;
      return true;
    }));
    EXPECT_EQ(last_frac, 1.0);
    EXPECT_GT(run.renderer().scene_stats().samples, 100U);
    EXPECT_FALSE(run.renderer().scene_stats().samples_full);
    EXPECT_TRUE(warm_up_warnings(run.renderer().scene_stats()).empty());
  }
  EXPECT_GT(reports, 4);
  // Every report can stop it: those of samples and of the exchange.
  for (int stop = 1; stop <= reports; ++stop) {
    Session run(scenario);
    int seen = 0;
    EXPECT_FALSE(run.renderer().warm_up(request, [&](double) { return ++seen < stop; })) << stop;
    EXPECT_EQ(seen, stop);
  }
}

TEST(RendererCached, TheLimitOfSamplesIsKeptAndSaid) {
  auto scenario = cached_scenario(box_on_ground());
  scenario.thermal.max_samples = 300;
  Session run(scenario);
  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = kHourNs;
  request.sensor_pose = looking({3.0, -9.0, 6.0}, {0.0, 0.0, 0.0});
  const int slot = run.renderer().submit(request);
  EXPECT_TRUE(run.renderer().collect(static_cast<renderer::SlotIndex>(slot)).stats.coarse.any());
  EXPECT_LE(run.renderer().scene_stats().samples, 300U);
  EXPECT_TRUE(run.renderer().scene_stats().samples_full);
  EXPECT_FALSE(run.renderer().scene_stats().coarse_meshes);
  const auto warnings = warm_up_warnings(run.renderer().scene_stats());
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("max_samples = 300 stopped"), std::string::npos) << warnings[0];
  EXPECT_NE(warnings[0].find("600 or more"), std::string::npos) << warnings[0];
}

TEST(RendererCached, TheLimitOfSamplesHoldsBesideEdges) {
  // Small blocks are refined most near their edges.
  std::vector<Quad> quads = box({-0.4, -0.4, 0.0}, {0.4, 0.4, 0.8});
  for (int i = 0; i < 6; ++i) {
    const double x_m = 1.5 * i - 4.0;
    for (const Quad& quad : box({x_m, 1.0, 0.0}, {x_m + 0.4, 1.4, 0.5})) quads.push_back(quad);
  }
  quads.push_back(ground(12.0, 12.0));
  for (const std::uint32_t max_samples : {1000U, 2000U, 3000U}) {
    auto scenario = cached_scenario(write_quads("blocks", quads));
    scenario.thermal.model = scene::ThermalModel::foster;
    scenario.thermal.tolerance_k = 0.05;
    scenario.thermal.max_samples = max_samples;
    Session run(scenario);
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = kHourNs;
    request.sensor_pose = looking({3.0, -9.0, 6.0}, {0.0, 0.0, 0.0});
    ASSERT_TRUE(run.renderer().warm_up(request));
    const renderer::SceneStats& stats = run.renderer().scene_stats();
    EXPECT_TRUE(stats.samples_full);
    EXPECT_LE(stats.samples, max_samples);
    EXPECT_GT(stats.samples, max_samples * 9 / 10);  // and is made use of
  }
}

TEST(RendererCached, ALimitBelowTheMeshesOwnVerticesSaysByHowMuchItDoesNotBind) {
  std::vector<Quad> quads;
  for (int i = 0; i < 60; ++i) {
    const double x_m = 0.4 * i - 12.0;
    for (const Quad& quad : box({x_m, 1.0, 0.0}, {x_m + 0.2, 1.2, 0.5})) quads.push_back(quad);
  }
  auto scenario = cached_scenario(write_quads("blocks", quads));
  scenario.thermal.max_samples = 1000;
  Session run(scenario);
  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = kHourNs;
  request.sensor_pose = looking({3.0, -9.0, 6.0}, {0.0, 0.0, 0.0});
  ASSERT_TRUE(run.renderer().warm_up(request));
  const renderer::SceneStats& stats = run.renderer().scene_stats();
  EXPECT_GE(stats.samples, 1200U);
  const auto warnings = warm_up_warnings(stats);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("does not bind"), std::string::npos) << warnings[0];
  EXPECT_NE(warnings[0].find(std::to_string(stats.samples)), std::string::npos) << warnings[0];
}

TEST(RendererCached, AMeshFinerThanThePixelsIsSampledAsTheCameraNeedsIt) {
  // Use ground of squares of 6 cm. A pixel is as wide as two or three of them.
  std::vector<Quad> quads = box({-2.0, -2.0, 0.0}, {2.0, 2.0, 3.0});
  constexpr double kSquareM = 0.0625;  // exact in float32, so that neighbours meet
  for (int i = 0; i < 200; ++i) {
    for (int j = 0; j < 200; ++j) {
      const glm::dvec3 low(kSquareM * (i - 100), kSquareM * (j - 100), 0.0);
      const glm::dvec3 x(kSquareM, 0.0, 0.0);
      const glm::dvec3 y(0.0, kSquareM, 0.0);
      quads.push_back({low, low + x, low + x + y, low + y});
    }
  }
  auto scenario = cached_scenario(write_quads("fine", quads));
  scenario.clear_sky.wind_m_s = kBreezeMS;
  const auto pose = looking({0.0, -8.0, 24.0}, {0.0, 0.0, 0.0});
  const auto shot = [&](bool announced) {
    scenario.sensor.trajectory = announced ? scene::Trajectory{{0, pose}} : scene::Trajectory{};
    Session run(scenario);
    auto picture = run.frame_k(3 * kHourNs, pose);
    return std::pair(std::move(picture), run.renderer().scene_stats().samples);
  };
  const auto [whole, all_samples] = shot(false);
  const auto [reduced, few_samples] = shot(true);
  EXPECT_GT(all_samples, 40000U);
  EXPECT_LT(few_samples, 15000U);
  std::vector<double> errors;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    if (std::isnan(whole[i])) continue;
    errors.push_back(std::abs(static_cast<double>(whole[i]) - static_cast<double>(reduced[i])));
  }
  std::ranges::sort(errors);
  ASSERT_GT(errors.size(), 2500U);
  // Leave out the edge of the shadow, which is less than a pixel wide here.
  EXPECT_LT(errors[errors.size() / 2], 0.02);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.2);
}

TEST(RendererCached, WhatNoEyeSeesIsNotRefined) {
  // Look from below, where the ground shows its back and hides everything that stands on it.
  const auto scenario = cached_scenario(box_on_ground());
  const auto samples_from = [&](double up_m) {
    Session run(scenario);
    (void)run.frame_k(2 * kHourNs, looking({-9.0, 0.0, up_m}, {-2.0, 0.0, 0.0}));
    return run.renderer().scene_stats().samples;
  };
  EXPECT_GT(samples_from(6.0), 2 * samples_from(-6.0));
}

TEST(RendererCached, GroundUnderABodyDoesNotShowThroughAtItsFoot) {
  // Look at the ground west of the box, which has been in its shade since the start two hours ago.
  auto scenario = cached_scenario(box_on_ground());
  scenario.sensor.fov_h_rad = 0.35;
  scenario.materials[0].base_k = 340.0;  // makes covered ground hot
  const auto seen_from = [&](const glm::dvec3& eye, const glm::dvec3& at) {
    return Session(scenario).frame_k(2 * kHourNs, looking(eye, at));
  };
  const auto sunlit = seen_from({9.0, -9.0, 4.0}, {6.0, -6.0, 0.0});
  const float ground_k = sunlit[sunlit.size() / 2 + kWidth / 2];
  const auto foot = seen_from({-3.0, 0.1, 0.8}, {-1.0, 0.1, 0.05});
  const auto [low, high] = std::ranges::minmax(foot);
  EXPECT_LT(high, ground_k - 5.0F);
  EXPECT_LT(high - low, 1.5F);
}

TEST(RendererCached, FramesFromWhereNoOneSaidTheCameraWouldBeAreFlagged) {
  auto scenario = cached_scenario(box_on_ground());
  const glm::dvec3 eye(3.0, -9.0, 6.0);
  const auto pose = looking(eye, {0.0, 0.0, 0.0});
  scenario.sensor.trajectory = {{0, pose}};
  Session run(scenario);
  const auto coarse_at = [&](const glm::dvec3& from) {
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = kHourNs;
    request.sensor_pose = looking(from, {0.0, 0.0, 0.0});
    const int slot = run.renderer().submit(request);
    const auto& view = run.renderer().collect(static_cast<renderer::SlotIndex>(slot));
    const bool coarse = view.stats.coarse.any();
    run.renderer().release(static_cast<renderer::SlotIndex>(slot));
    return coarse;
  };
  EXPECT_FALSE(coarse_at(eye));
  EXPECT_FALSE(coarse_at(eye + glm::dvec3(0.02, 0.0, 0.0)));
  EXPECT_TRUE(coarse_at({1.0, -4.0, 3.0}));
  EXPECT_TRUE(coarse_at({-3.0, 9.0, 6.0}));
  EXPECT_FALSE(coarse_at(eye));
}

TEST(RendererCachedSurface, PassesTemperaturesOnWithinAQuarterOfAMillikelvin) {
  for (const double prescribed_k : {100.0, 301.23456, 5000.0}) {
    auto scenario = cached_scenario(write_quads("plane", {ground(50.0, 50.0)}));
    scenario.materials[0].prescribed_k = prescribed_k;
    Session session(scenario);
    const auto frame_k = session.frame_k(2 * kHourNs, looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0}));
    const double floats_k = 3.0 * 1.2e-7 * prescribed_k;  // error of interpolation in float32
    for (const float k : frame_k) ASSERT_NEAR(k, prescribed_k, 0.5 / 2048.0 + floats_k);
  }
}

TEST(RendererCached, GroundUnderARoofHasKnownItsShadeForDaysFromTheFirstFrameOn) {
  // A roof of 8 m by 8 m, 2.5 m above ground; the camera looks below it.
  auto quads = box({-4.0, -4.0, 2.5}, {4.0, 4.0, 2.7});
  const Quad under = ground(4.0, 4.0, 2.5);
  quads.push_back({under.d, under.c, under.b, under.a});
  quads.push_back(ground(15.0, 15.0));
  auto scenario = cached_scenario(write_quads("roof", quads));
  scenario.thermal.spin_up_ns = 0;
  // This is the start that scenarios have which state none.
  scenario.thermal.history_start_ns = -84 * kHourNs;
  scenario.thermal.steps = 64;
  // The ground forgets within days. The judge has another temperature at its start, 20 days ago.
  scenario.materials[0].layers.back().thickness_m = 0.1;
  scenario.materials[0].foster_modes.clear();
  auto weeks = scenario;
  weeks.thermal.history_start_ns = -480 * kHourNs;
  weeks.thermal.steps = 300;
  scenario.thermal.initial_stated = false;
  for (const std::int64_t hours : {4, 14}) {
    const physics::Pose pose = looking({-2.0, -14.0, 1.6}, {0.5, 0.0, 0.0});
    const auto first_k = Session(scenario).frame_k(hours * kHourNs, pose);
    const auto weeks_k = Session(weeks).frame_k(hours * kHourNs, pose);
    const Difference off = difference(weeks_k, first_k);
    RecordProperty("p99_mk_" + std::to_string(hours), static_cast<int>(1e3 * off.p99_k));
    RecordProperty("max_mk_" + std::to_string(hours), static_cast<int>(1e3 * off.max_k));
    EXPECT_LT(off.p99_k, 0.5) << hours;
  }
}

}  // namespace
}  // namespace emit::test
