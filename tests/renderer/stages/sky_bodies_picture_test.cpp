// SPDX-License-Identifier: Apache-2.0
// Pictures of sun and moon: their light against the irradiance that the same band has, every pixel
// against the reference, which sends rays, and the terms of a pixel against the pixel.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/air_model.hpp"
#include "emit/physics/clear_sky.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/frames.hpp"
#include "emit/physics/planck.hpp"
#include "emit/physics/sky/moon.hpp"
#include "emit/physics/sun.hpp"
#include "emit/reference/solve.hpp"
#include "emit/scene/mesh.hpp"
#include "support/renderer_scene.hpp"

namespace emit::test {
namespace {

constexpr std::int64_t kNsPerS = 1'000'000'000;

/// Ground of a known temperature in the air of the model, or without air.
scene::ScenarioDesc sky_scenario(bool air) {
  auto scenario = instant_scenario(write_quads("plane", {ground(200.0, 200.0)}));
  scenario.bands = {{"3-5", 3.0, 5.0, {}}, {"8-12", 8.0, 12.0, {}}};
  scenario.materials[0].prescribed_k = 300.0;
  scenario.materials[0].band_emissivity = {{"3-5", 1.0}, {"8-12", 1.0}};
  scenario.weather = {};  // the sun of a clear sky
  scenario.sensor.width_px = 96;
  scenario.sensor.height_px = 80;
  if (air) {
    scenario.atmosphere.enabled = true;
    for (const char* name : {"3-5", "8-12"}) {
      scene::BandAtmosphere entry;
      entry.band = name;
      entry.model = physics::AirSpec{physics::AirClimate::midlatitude_summer, 23.0, 1.0};
      scenario.atmosphere.bands.push_back(entry);
    }
  }
  return scenario;
}

physics::GeoPlace place_of(const scene::ScenarioDesc& scenario) {
  return {physics::Radians(scenario.place.lat_rad), physics::Radians(scenario.place.lon_rad),
          physics::Metres(scenario.place.height_m)};
}

struct Picture {
  std::vector<std::vector<float>> radiance;  // by band
  std::vector<float> depth_m;
  std::vector<std::vector<renderer::RadianceTerms>> terms;  // by pixel asked for, by band
};

Picture render(const scene::ScenarioDesc& scenario, const physics::Pose& pose,
               std::int64_t sim_time_ns, std::vector<glm::uvec2> asked = {}) {
  renderer::OutputOptions output;
  output.temperature = output.depth = output.sun = output.sky = output.terms = true;
  Picture out;
  auto made = renderer::Renderer::create(scenario, {}, output);
  if (!made) {
    ADD_FAILURE() << made.error().text;
    return out;
  }
  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = sim_time_ns;
  request.sensor_pose = pose;
  const int slot = (*made)->submit(request);
  const auto& view = (*made)->collect(static_cast<renderer::SlotIndex>(slot));
  EXPECT_EQ(view.stats.nonfinite_px, 0U);
  EXPECT_EQ(view.stats.clamped_px, 0U);
  for (std::size_t b = 0; b < scenario.bands.size(); ++b) {
    out.radiance.emplace_back(view.radiance_w_m2_sr[b].begin(), view.radiance_w_m2_sr[b].end());
  }
  out.depth_m.assign(view.depth_m.begin(), view.depth_m.end());
  for (const glm::uvec2& px : asked) out.terms.push_back((*made)->radiance_terms(view, px, 1.0));
  return out;
}

/// Camera that looks at a direction from 10 m above the ground.
physics::Pose facing(const glm::dvec3& towards) {
  const glm::dvec3 eye(0.0, 0.0, 10.0);
  return {eye, physics::world_from_body_look_at(eye, eye + 1000.0 * towards)};
}

/// Solid angle of a pixel.
double pixel_sr(const scene::SensorDesc& sensor, std::size_t i) {
  const double per_px = 2.0 * std::tan(0.5 * sensor.fov_h_rad) / sensor.width_px;
  const double x =
      (static_cast<double>(i % sensor.width_px) + 0.5 - 0.5 * sensor.width_px) * per_px;
  const double y =
      (static_cast<double>(i / sensor.width_px) + 0.5 - 0.5 * sensor.height_px) * per_px;
  return per_px * per_px * std::pow(1.0 + x * x + y * y, -1.5);
}

TEST(SkyBodies, the_sun_in_the_picture_has_the_light_of_the_sun) {
  for (const auto& [air, fov_deg] : {std::pair{true, 3.0}, std::pair{false, 3.0},
                                     std::pair{false, 40.0}, std::pair{true, 110.0}}) {
    SCOPED_TRACE(testing::Message() << (air ? "air " : "no air ") << fov_deg);
    scene::ScenarioDesc scenario = sky_scenario(air);
    scenario.sensor.fov_h_rad = fov_deg * physics::kDegree;
    const std::int64_t at_ns = 4 * 3600 * kNsPerS;
    const physics::SunPosition sun =
        physics::sun_position(scenario.epoch_utc_ns + at_ns, place_of(scenario));
    const Picture with = render(scenario, facing(sun.direction_enu), at_ns);
    for (std::size_t b = 0; b < 2; ++b) {
      const auto terms = physics::BandAir::build(scene::spectral_band(scenario.bands[b]));
      ASSERT_TRUE(terms);
      double expected = terms->sun_outside_w_m2() / std::pow(sun.distance_au, 2);
      if (air) {
        const auto column = physics::AirColumn::build(*scenario.atmosphere.bands[b].model);
        expected *=
            terms->transmittance(physics::AirPath::to_space(*column, scenario.place.height_m + 10.0,
                                                            sun.elevation.value()),
                                 physics::AirSource::sun_lowtran);
      }
      // Take off the sky, which is as bright on both sides.
      const double disc_px = 0.27 * 96.0 / fov_deg;
      const auto reach = static_cast<std::size_t>(disc_px) + 2;
      double sum_w_m2 = 0.0;
      for (std::size_t y = 40 - reach; y < 40 + reach; ++y) {
        const float* row = &with.radiance[b][y * scenario.sensor.width_px];
        const double sky = 0.5 * (row[48 - reach - 1] + row[48 + reach]);
        for (std::size_t x = 48 - reach; x < 48 + reach; ++x) {
          sum_w_m2 += (row[x] - sky) * pixel_sr(scenario.sensor, y * 96 + x);
        }
      }
      EXPECT_NEAR(sum_w_m2 / expected, 1.0, 0.01) << scenario.bands[b].name;
    }
  }
}

TEST(SkyBodies, clouds_hide_the_sun_by_their_share) {
  scene::ScenarioDesc scenario = sky_scenario(false);
  scenario.sensor.fov_h_rad = 3.0 * physics::kDegree;
  const std::int64_t at_ns = 4 * 3600 * kNsPerS;
  const physics::SunPosition sun =
      physics::sun_position(scenario.epoch_utc_ns + at_ns, place_of(scenario));
  const std::size_t middle = 40 * 96 + 48;
  const float clear = render(scenario, facing(sun.direction_enu), at_ns).radiance[0][middle];
  // Half of a clear sky's beam arrives.
  const double beam = physics::clear_sky_irradiance(sun, physics::Metres(scenario.place.height_m),
                                                    scenario.clear_sky.linke_turbidity)
                          .direct_normal_w_m2;
  scenario.weather = {weather(0.5 * beam, 100.0, 330.0, 290.0)};
  const float half = render(scenario, facing(sun.direction_enu), at_ns).radiance[0][middle];
  EXPECT_NEAR(half / clear, 0.5, 0.02);
  scenario.weather = {weather(0.0, 100.0, 380.0, 290.0)};
  const float none = render(scenario, facing(sun.direction_enu), at_ns).radiance[0][middle];
  EXPECT_LT(none, 1e-3F * clear);
}

TEST(SkyBodies, every_pixel_is_that_of_the_reference) {
  // 2014-06-21 is the epoch's day: a waning moon of a quarter stands in the morning sky.
  scene::ScenarioDesc scenario = sky_scenario(true);
  const std::int64_t at_ns = 3600 * kNsPerS;
  const physics::MoonPosition moon =
      physics::moon_position(scenario.epoch_utc_ns + at_ns, place_of(scenario));
  const physics::SunPosition sun =
      physics::sun_position(scenario.epoch_utc_ns + at_ns, place_of(scenario));
  ASSERT_GT(moon.direction_enu.z, 0.05);
  const scene::AtmosphereDesc air = scenario.atmosphere;
  for (const auto& [of_moon, fov_deg, has_air] :
       {std::tuple{true, 1.2, true}, std::tuple{false, 30.0, true}, std::tuple{true, 12.0, false},
        std::tuple{true, 30.0, false}, std::tuple{false, 1.2, false}}) {
    SCOPED_TRACE(testing::Message() << (of_moon ? "moon " : "sun ") << fov_deg);
    scenario.atmosphere = has_air ? air : scene::AtmosphereDesc{};
    scenario.atmosphere.enabled = has_air;
    scenario.sensor.fov_h_rad = fov_deg * physics::kDegree;
    const physics::Pose pose = facing(of_moon ? moon.direction_enu : sun.direction_enu);
    std::vector<glm::uvec2> asked;
    for (std::uint32_t x = 40; x < 56; ++x) asked.push_back({x, 40});
    const Picture shown = render(scenario, pose, at_ns, asked);
    const auto geometry = scene::load_scene(scenario);
    ASSERT_TRUE(geometry);
    reference::SolveOptions options;
    options.rays = 4;
    options.pixels = 1;  // of the ground, which is not compared
    auto solver = reference::SceneSolver::create(scenario, *geometry, options, at_ns);
    ASSERT_TRUE(solver) << solver.error().text;
    const auto truth = solver->image({at_ns, pose, scenario.sensor.width_px,
                                      scenario.sensor.height_px, scenario.sensor.fov_h_rad});
    ASSERT_TRUE(truth) << truth.error().text;
    for (std::size_t b = 0; b < 2; ++b) {
      const auto& own = truth->radiance_w_m2_sr[b];
      double most = 0.0;
      for (const float value : own) most = std::max(most, std::isnan(value) ? 0.0 : double{value});
      double sum = 0.0;
      double difference = 0.0;
      for (std::size_t i = 0; i < own.size(); ++i) {
        if (std::isfinite(shown.depth_m[i])) continue;
        // A moon of less than four pixels is evenly bright: it has its light, but no phase.
        const bool even = of_moon && fov_deg > 20.0;
        if (!even) {
          EXPECT_NEAR(shown.radiance[b][i] / most, own[i] / most, 0.05) << i;
        }
        sum += own[i];
        difference += shown.radiance[b][i] - own[i];
      }
      // Points at the rim of a narrow crescent count for much, here and in the reference.
      EXPECT_LT(std::abs(difference), (of_moon ? 0.05 : 0.02) * sum);
      for (std::size_t k = 0; k < asked.size(); ++k) {
        const double pixel = shown.radiance[b][asked[k].y * scenario.sensor.width_px + asked[k].x];
        EXPECT_NEAR(shown.terms[k][b].sum_w_m2_sr(), pixel, 5e-4 * most) << k;
      }
    }
  }
}

TEST(SkyBodies, a_full_moon_is_as_hot_as_telescopes_see_it) {
  // 2014-06-13, 04:11 UT was full moon; half a day later it is near full, above the horizon
  // somewhere. A ball whose places are in balance with the sun sends as much as (2/3)^(1/4) of 394
  // K, 356 K, and a little less in 8-12 um and in June. Telescopes see some 365 K, as the rim is
  // warmer than that.
  scene::ScenarioDesc scenario = sky_scenario(false);
  scenario.epoch_utc_ns = 1402632660LL * kNsPerS;
  scenario.sensor.fov_h_rad = 0.8 * physics::kDegree;
  physics::MoonPosition moon;
  double lon_deg = -170.0;
  for (; lon_deg < 180.0; lon_deg += 5.0) {
    scenario.place.lon_rad = lon_deg * physics::kDegree;
    moon = physics::moon_position(scenario.epoch_utc_ns, place_of(scenario));
    if (moon.direction_enu.z > 0.3) break;
  }
  ASSERT_GT(moon.direction_enu.z, 0.3);
  const Picture shown = render(scenario, facing(moon.direction_enu), 0);
  double sum_w_m2 = 0.0;
  for (std::size_t i = 0; i < shown.radiance[1].size(); ++i) {
    if (!std::isfinite(shown.depth_m[i])) {
      sum_w_m2 += shown.radiance[1][i] * pixel_sr(scenario.sensor, i);
    }
  }
  const double disc_sr = physics::kPi * std::pow(physics::kMoonRadiusM / moon.distance_m, 2);
  const double mean_w_m2_sr = sum_w_m2 / disc_sr;
  const auto black = [](double kelvin) {
    return physics::band_radiance({8.0, 12.0, {}}, physics::Kelvin(kelvin)).radiance_w_m2_sr;
  };
  EXPECT_GT(mean_w_m2_sr, black(345.0));
  EXPECT_LT(mean_w_m2_sr, black(365.0));
}

}  // namespace
}  // namespace emit::test
