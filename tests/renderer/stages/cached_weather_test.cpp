// SPDX-License-Identifier: Apache-2.0
// Weather that the host changes acts from its time stamp on, is taken in over some frames, and
// becomes part of the history.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "support/cached_session.hpp"
#include "support/renderer_scene.hpp"

namespace emit::test {
namespace {

constexpr std::int64_t kFrameNs = kSecondNs / 4;
constexpr std::size_t kMiddle = kHeight / 2 * kWidth + kWidth / 2;

/// Weather of the clear sky at an instant, with a share of its direct sun and with air warmer by
/// `air_k`.
scene::WeatherSample weather_at(const scene::ScenarioDesc& scenario, std::int64_t at_ns,
                                double sun_frac, double air_k = 0.0) {
  const renderer::Environment environment(scenario);
  const physics::Forcing clear = environment.forcing_at(at_ns, environment.sun_at(at_ns));
  scene::WeatherSample out;
  out.sim_time_ns = at_ns;
  out.direct_normal_w_m2 = sun_frac * clear.direct_normal_w_m2;
  out.diffuse_horizontal_w_m2 = clear.diffuse_horizontal_w_m2;
  out.longwave_down_w_m2 = clear.longwave_down_w_m2;
  out.air_k = clear.air_k + air_k;
  out.wind_m_s = clear.wind_m_s;
  return out;
}

/// Open ground under weather that the host sends, in steps that are short compared with its
/// changes. The history up to the first sample is computed once.
class ToldGround {
 public:
  ToldGround(const scene::ScenarioDesc& s, std::span<const scene::WeatherSample> told)
      : ground_(s, told, told.front().sim_time_ns) {}
  /// Returns the temperature at an instant that is not before the last one that was asked for.
  double temperature_k(std::int64_t now_ns) {
    while (ground_.at_ns() < now_ns) ground_.go_on(std::min(now_ns, ground_.at_ns() + kFrameNs));
    return ground_.temperature_k();
  }

 private:
  OpenGround ground_;
};

double told_ground_k(const scene::ScenarioDesc& s, std::span<const scene::WeatherSample> told,
                     std::int64_t now_ns) {
  return ToldGround(s, told).temperature_k(now_ns);
}

scene::ScenarioDesc open_ground() {
  return cached_scenario(write_quads("ground", {ground(14.0, 14.0)}));
}

TEST(RendererCachedWeather, ACloudActsFromItsInstantOn) {
  const auto scenario = open_ground();
  const auto pose = looking({0.0, -0.01, 12.0}, {0.0, 0.0, 0.0});
  // Put the change into the middle of an interval of 20 s, right before its end, and at its end.
  for (const std::int64_t quarters : {28, 79, 80}) {
    SCOPED_TRACE(quarters);
    const std::int64_t event_ns = 2 * kHourNs + quarters * kFrameNs;
    const std::vector told{weather_at(scenario, event_ns, 0.0)};
    ToldGround expected(scenario, told);
    Session run(scenario);
    std::int64_t now_ns = 2 * kHourNs + kFrameNs / 2;
    float last_k = run.frame_k(now_ns, pose)[kMiddle];
    int after = 0;  // number of frames since the change
    double most_step_k = 0.0;
    double most_off_k = 0.0;
    while (now_ns < event_ns + 60 * kSecondNs) {
      const bool before = now_ns < event_ns;
      now_ns += kFrameNs;
      if (before && now_ns >= event_ns) {
        ASSERT_TRUE(run.renderer().apply_weather(told[0]));
      }
      const float is_k = run.frame_k(now_ns, pose)[kMiddle];
      most_step_k = std::max(most_step_k, std::abs(static_cast<double>(is_k) - last_k));
      last_k = is_k;
      if (now_ns < event_ns) continue;
      // Expect that ten frames take the change in, each for a part of the surface.
      ++after;
      EXPECT_EQ(run.coarse(), after <= 10) << after;
      if (after % 4 != 1) continue;
      const double off_k = std::abs(is_k - expected.temperature_k(now_ns));
      most_off_k = std::max(most_off_k, off_k);
    }
    // Expect that the ground cools by kelvins meanwhile, while errors stay below 0.04 K. A pixel
    // steps by what the ground has cooled since the change when its share is computed.
    EXPECT_GT(open_ground_k(scenario, now_ns) - last_k, 2.0);
    EXPECT_LT(most_step_k, 0.08);
    EXPECT_LT(most_off_k, 0.04);
  }
}

TEST(RendererCachedWeather, AfterAJumpItHasActedAsLongAsItWould) {
  const auto scenario = open_ground();
  const auto pose = looking({0.0, -0.01, 12.0}, {0.0, 0.0, 0.0});
  const std::int64_t event_ns = 2 * kHourNs + 33 * kSecondNs;
  const std::vector told{weather_at(scenario, event_ns, 0.3)};
  Session run(scenario);
  (void)run.frame_k(2 * kHourNs, pose);
  ASSERT_TRUE(run.renderer().apply_weather(told[0]));
  const std::int64_t now_ns = event_ns + 90 * kSecondNs;
  EXPECT_NEAR(run.frame_k(now_ns, pose)[kMiddle], told_ground_k(scenario, told, now_ns), 0.05);
}

TEST(RendererCachedWeather, WhatIsToldEverySecondIsFollowed) {
  // Let the sun fade within a minute, with updates so frequent that no interval ends meanwhile.
  const auto scenario = open_ground();
  const auto pose = looking({0.0, -0.01, 12.0}, {0.0, 0.0, 0.0});
  std::vector<scene::WeatherSample> told;
  Session run(scenario);
  std::int64_t now_ns = 2 * kHourNs;
  (void)run.frame_k(now_ns, pose);
  for (int f = 1; f <= 320; ++f) {
    now_ns += kFrameNs;
    if (f % 4 == 0 && f <= 240) {
      told.push_back(weather_at(scenario, now_ns, 1.0 - f / 240.0, f / 120.0));
      ASSERT_TRUE(run.renderer().apply_weather(told.back()));
    }
    const float is_k = run.frame_k(now_ns, pose)[kMiddle];
    if (f % 40 == 0) {
      EXPECT_NEAR(is_k, told_ground_k(scenario, told, now_ns), 0.02) << f;
    }
  }
}

TEST(RendererCachedWeather, RainActsFromItsInstantOn) {
  auto scenario = open_ground();
  scenario.materials[0].water_store_mm = 0.48;
  const auto pose = looking({0.0, -0.01, 12.0}, {0.0, 0.0, 0.0});
  const std::int64_t event_ns = 2 * kHourNs + 28 * kFrameNs;
  std::vector told{weather_at(scenario, event_ns, 1.0),
                   weather_at(scenario, event_ns + 40 * kSecondNs, 1.0)};
  told[0].rain_mm_h = 12.0;
  ToldGround expected(scenario, told);
  Session run(scenario);
  std::int64_t now_ns = 2 * kHourNs + kFrameNs / 2;
  (void)run.frame_k(now_ns, pose);
  std::size_t next = 0;
  double most_off_k = 0.0;
  float is_k = 0.0F;
  for (int frame = 0; now_ns < event_ns + 100 * kSecondNs; ++frame) {
    now_ns += kFrameNs;
    if (next < told.size() && now_ns >= told[next].sim_time_ns) {
      ASSERT_TRUE(run.renderer().apply_weather(told[next++]));
    }
    is_k = run.frame_k(now_ns, pose)[kMiddle];
    // The ground takes in a change over ten frames.
    if (now_ns < event_ns + 4 * kSecondNs || frame % 8 != 0) continue;
    most_off_k = std::max(most_off_k, std::abs(is_k - expected.temperature_k(now_ns)));
  }
  EXPECT_LT(most_off_k, 0.2);
  EXPECT_GT(open_ground_k(scenario, now_ns) - is_k, 1.5);
  EXPECT_FALSE(run.coarse());
}

TEST(RendererCachedWeather, FramesSayThatNobodyKnowsWhatRainDoes) {
  const auto scenario = open_ground();  // its material has no store of water
  const auto pose = looking({0.0, -0.01, 12.0}, {0.0, 0.0, 0.0});
  renderer::OutputOptions output;
  auto made = renderer::Renderer::create(scenario, {}, output);
  ASSERT_TRUE(made) << made.error().text;
  const auto unknown = [&](std::int64_t at_ns) {
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = at_ns;
    request.sensor_pose = pose;
    const auto slot = static_cast<renderer::SlotIndex>((*made)->submit(request));
    return renderer::has((*made)->collect(slot).stats.heat_limits,
                         renderer::HeatLimit::rain_unknown);
  };
  EXPECT_FALSE(unknown(2 * kHourNs));
  scene::WeatherSample told = weather_at(scenario, 2 * kHourNs + kSecondNs, 1.0);
  told.rain_mm_h = 60.0;
  ASSERT_TRUE((*made)->apply_weather(told));
  EXPECT_FALSE(unknown(2 * kHourNs + 2 * kSecondNs)) << "drops";
  EXPECT_TRUE(unknown(2 * kHourNs + 10 * kSecondNs));
}

TEST(RendererCachedWeather, FramesSayThatAMaterialIsMoreThanDryLayers) {
  for (const auto method : {scene::ThermalMethod::cached, scene::ThermalMethod::per_frame}) {
    for (const bool valid : {true, false}) {
      auto scenario = open_ground();
      scenario.thermal.method = method;
      for (scene::Material& material : scenario.materials) material.dry_layers_valid = valid;
      auto made = renderer::Renderer::create(scenario, {}, renderer::OutputOptions{});
      ASSERT_TRUE(made) << made.error().text;
      renderer::FrameRequest request;
      request.sim_time_ns = request.thermal_time_ns = 2 * kHourNs;
      request.sensor_pose = looking({0.0, -0.01, 12.0}, {0.0, 0.0, 0.0});
      const auto slot = static_cast<renderer::SlotIndex>((*made)->submit(request));
      EXPECT_EQ(renderer::has((*made)->collect(slot).stats.heat_limits,
                              renderer::HeatLimit::layers_invalid),
                !valid);
    }
  }
}

TEST(RendererCachedWeather, FramesSayWhileSomeSurfacesDoNotKnowYet) {
  const auto scenario = open_ground();
  const auto pose = looking({0.0, -0.01, 12.0}, {0.0, 0.0, 0.0});
  const auto flagged = [&](double sun_frac, double cloud_frac, std::int64_t late_ns) {
    Session run(scenario);
    std::int64_t now_ns = 2 * kHourNs + 5 * kSecondNs;
    std::vector<bool> out;
    (void)run.frame_k(now_ns, pose);
    auto told = weather_at(scenario, now_ns + kFrameNs - late_ns, sun_frac);
    told.cloud_frac = cloud_frac;
    EXPECT_TRUE(run.renderer().apply_weather(told));
    for (int f = 0; f < 20; ++f) {
      now_ns += kFrameNs;
      (void)run.frame_k(now_ns, pose);
      out.push_back(run.coarse());
    }
    return out;
  };
  for (const auto& dark :
       {flagged(0.0, 0.0, 0), flagged(1.0, 0.8, 0), flagged(0.0, 0.0, 60 * kSecondNs)}) {
    EXPECT_TRUE(dark.front());
    EXPECT_TRUE(dark[8]);
    EXPECT_FALSE(dark[12]);  // an eighth of 20 s has passed
  }
  // Expect no flag for weather that does not differ from the weather before.
  EXPECT_EQ(std::ranges::count(flagged(1.0, 0.0, 0), true), 0);
}

TEST(RendererCachedWeather, WhatIsToldTwiceForOneInstantIsTheLatter) {
  const auto scenario = open_ground();
  const auto pose = looking({0.0, -0.01, 12.0}, {0.0, 0.0, 0.0});
  const std::int64_t event_ns = 2 * kHourNs + 15 * kSecondNs;
  const std::vector told{weather_at(scenario, event_ns, 0.9), weather_at(scenario, event_ns, 0.0)};
  ToldGround expected(scenario, std::span(told).last(1));
  Session run(scenario);
  float before_k = 0.0F;
  for (std::int64_t now_ns = 2 * kHourNs; now_ns < event_ns; now_ns += kFrameNs) {
    before_k = run.frame_k(now_ns, pose)[kMiddle];
  }
  for (const auto& sample : told) {
    ASSERT_TRUE(run.renderer().apply_weather(sample));
  }
  for (int f = 0; f <= 40; ++f) {
    const std::int64_t now_ns = event_ns + f * kFrameNs;
    const float is_k = run.frame_k(now_ns, pose)[kMiddle];
    if (f == 0) {
      EXPECT_NEAR(is_k, before_k, 0.02);
    }
    if (f % 10 == 0) {
      EXPECT_NEAR(is_k, expected.temperature_k(now_ns), 0.05) << f;
    }
  }
}

TEST(RendererCachedWeather, AHoldDoesNotKeepItUp) {
  const auto scenario = open_ground();
  const auto pose = looking({0.0, -0.01, 12.0}, {0.0, 0.0, 0.0});
  const std::int64_t held_ns = 2 * kHourNs + 5 * kSecondNs;
  Session run(scenario);
  const float before_k = run.frame_k(held_ns, pose)[kMiddle];
  ASSERT_TRUE(run.renderer().apply_weather(weather_at(scenario, held_ns, 0.0)));
  for (int f = 0; f < 70; ++f) {
    EXPECT_NEAR(run.frame_k(held_ns, pose)[kMiddle], before_k, 0.02);
    if (f == 10) {
      EXPECT_TRUE(run.coarse());
    }
  }
  EXPECT_FALSE(run.coarse());
}

TEST(RendererCachedWeather, WhatIsToldAheadWaitsForItsInstant) {
  const auto scenario = open_ground();
  const auto pose = looking({0.0, -0.01, 12.0}, {0.0, 0.0, 0.0});
  const std::int64_t event_ns = 2 * kHourNs + 31 * kSecondNs;
  const auto frames = [&](std::int64_t told_ns) {
    Session run(scenario);
    std::vector<float> out;
    for (std::int64_t now_ns = 2 * kHourNs; now_ns < event_ns + 30 * kSecondNs;
         now_ns += kSecondNs) {
      if (now_ns == told_ns) {
        EXPECT_TRUE(run.renderer().apply_weather(weather_at(scenario, event_ns, 0.2)));
      }
      out.push_back(run.frame_k(now_ns, pose)[kMiddle]);
    }
    return out;
  };
  const auto at_once = frames(event_ns);
  for (const std::int64_t ahead_s : {1, 5, 25}) {
    const auto ahead = frames(event_ns - ahead_s * kSecondNs);
    for (std::size_t i = 0; i < ahead.size(); ++i) {
      const bool settles = i > 31 && i < 42;
      EXPECT_NEAR(ahead[i], at_once[i], settles ? 0.1 : 0.03) << ahead_s << " s ahead, frame " << i;
    }
  }
}

TEST(RendererCachedWeather, BodiesThatTheHostMovesMeanwhileKeepTheirShade) {
  // Compare a plate that the host flies over the ground while clouds come and go with one that
  // flies by script, in intervals of a second.
  auto scenario = cached_scenario(write_quads("ground", fine_ground(12.0, 0.5)));
  scene::ObjectDesc plate = scenario.objects.front();
  plate.name = "plate";
  plate.gltf = write_quads("plate", {ground(2.0, 2.0)});
  plate.entity_id = 7;
  const std::int64_t start_ns = 2 * kHourNs;
  const std::int64_t end_ns = start_ns + 60 * kSecondNs;
  const auto at = [&](std::int64_t now_ns) {
    physics::Pose pose = plate.instances.front();
    pose.position_world_m = {-6.0 + 0.1e-9 * static_cast<double>(now_ns - start_ns), 0.0, 3.0};
    return pose;
  };
  plate.instances = {at(start_ns)};
  const auto run_with = [&](bool host) {
    auto s = scenario;
    s.objects.push_back(plate);
    if (!host) {
      s.objects.back().trajectory = {{start_ns, at(start_ns)}, {end_ns, at(end_ns)}};
      s.thermal.first_step_s = 1.0;
    }
    Session run(s, {.object = true});
    const auto pose = looking({0.0, -0.01, 20.0}, {0.0, 0.0, 0.0});
    std::vector<std::vector<float>> out;
    int f = 0;
    for (std::int64_t now_ns = start_ns; now_ns < end_ns; now_ns += kFrameNs, ++f) {
      if (host) {
        const renderer::EntityUpdate update{7, at(now_ns), true, false};
        EXPECT_EQ(run.renderer().apply_entities(now_ns, {&update, 1}), 1U);
      }
      if (f == 50 || f == 53 || f == 120) {
        EXPECT_TRUE(run.renderer().apply_weather(weather_at(scenario, now_ns,
                                                            f == 50   ? 0.8
                                                            : f == 53 ? 0.3
                                                                      : 1.0)));
      }
      auto frame = run.frame_k(now_ns, pose);
      for (std::size_t i = 0; i < frame.size(); ++i) {
        if (run.objects()[i] != 1.0F) frame[i] = std::numeric_limits<float>::quiet_NaN();
      }
      if (f % 40 == 39) out.push_back(std::move(frame));
    }
    return out;
  };
  const auto driven = run_with(true);
  const auto scripted = run_with(false);
  for (std::size_t i = 0; i < driven.size(); ++i) {
    const Difference off = difference(driven[i], scripted[i]);
    EXPECT_LT(off.p99_k, 0.03) << i;
  }
  // Expect that the shade of the plate is in the images.
  std::vector<float> ground_k = driven.back();
  std::erase_if(ground_k, [](float k) { return std::isnan(k); });
  const auto [coldest, warmest] = std::ranges::minmax(ground_k);
  EXPECT_GT(warmest - coldest, 0.5F);
}

TEST(RendererCachedWeather, GroundThatAPlateHasJustLeftStartsFromItsOwnState) {
  // Let the host hold a plate over the ground and take it away right before an interval of 20 s
  // ends. The ground has joined the next interval when the sun vanishes within it. Compare with a
  // plate that flies by script, in intervals of a second.
  auto scenario = cached_scenario(write_quads("ground", fine_ground(12.0, 0.5)));
  scene::ObjectDesc plate = scenario.objects.front();
  plate.name = "plate";
  plate.gltf = write_quads("plate", {ground(3.0, 3.0)});
  plate.entity_id = 7;
  const std::int64_t start_ns = 2 * kHourNs;
  const std::int64_t comes_ns = start_ns + 28 * kSecondNs;
  const std::int64_t goes_ns = start_ns + 39 * kSecondNs;
  const std::int64_t event_ns = start_ns + 48 * kSecondNs;
  const std::int64_t end_ns = start_ns + 70 * kSecondNs;
  const auto placed = [&](double x_m) {
    physics::Pose pose = plate.instances.front();
    pose.position_world_m = {x_m, 0.0, 3.0};
    return pose;
  };
  const auto away = placed(300.0);
  const auto there = placed(0.0);
  plate.instances = {away};
  const auto run_with = [&](bool host) {
    auto s = scenario;
    s.objects.push_back(plate);
    if (!host) {
      s.objects.back().trajectory = {{start_ns, away},     {comes_ns - 1, away}, {comes_ns, there},
                                     {goes_ns - 1, there}, {goes_ns, away},      {end_ns, away}};
      s.thermal.first_step_s = 1.0;
    }
    Session run(s);
    const auto pose = looking({0.0, -0.01, 20.0}, {0.0, 0.0, 0.0});
    std::vector<std::vector<float>> out;
    for (std::int64_t now_ns = start_ns; now_ns < end_ns; now_ns += kFrameNs) {
      if (host) {
        const bool is_there = now_ns >= comes_ns && now_ns < goes_ns;
        const renderer::EntityUpdate update{7, is_there ? there : away, true, false};
        EXPECT_EQ(run.renderer().apply_entities(now_ns, {&update, 1}), 1U);
      }
      if (now_ns == event_ns) {
        EXPECT_TRUE(run.renderer().apply_weather(weather_at(scenario, now_ns, 0.0)));
      }
      auto frame = run.frame_k(now_ns, pose);
      if (now_ns >= goes_ns && (now_ns - goes_ns) % (5 * kSecondNs) == 0) {
        out.push_back(std::move(frame));
      }
    }
    return out;
  };
  const auto driven = run_with(true);
  const auto scripted = run_with(false);
  const auto [coldest, warmest] = std::ranges::minmax(driven.front());
  EXPECT_GT(warmest - coldest, 0.5F);  // the print of the plate is in the images
  for (std::size_t i = 1; i < driven.size(); ++i) {
    const Difference off = difference(driven[i], scripted[i]);
    // Allow more right after the event, while it is taken in over some frames.
    const bool settles = i == 2;
    EXPECT_LT(off.p99_k, settles ? 0.18 : 0.1) << i;
  }
}

}  // namespace
}  // namespace emit::test
