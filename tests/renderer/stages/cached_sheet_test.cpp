// SPDX-License-Identifier: Apache-2.0
// Sheets with the method "cached" have one temperature, which the fluxes of both faces drive.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "support/renderer_scene.hpp"
#include "support/times.hpp"

namespace emit::test {
namespace {

using emit::test::kSecondNs;
constexpr std::int64_t kHourNs = 3600 * kSecondNs;
constexpr std::uint32_t kWidth = 96;
constexpr std::uint32_t kHeight = 80;
constexpr scene::Layer kSteel{0.002, 50.0, 7850.0, 470.0};
constexpr double kUpM = 4.0;

/// Scenario with a level plate in the air whose front faces up or down, and with other faces.
scene::ScenarioDesc plate(bool faces_up, scene::ThermalModel model, std::vector<Quad> others = {}) {
  Quad quad = ground(3.0, 3.0, kUpM);
  if (!faces_up) std::swap(quad.b, quad.d);
  others.push_back(quad);
  scene::ScenarioDesc s = instant_scenario(write_quads("plate", others, true));
  s.materials[0].layers = {kSteel, {0.02, 0.16, 1.2, 1005.0}};
  s.materials[0].base_k = 350.0;  // must not influence a sheet
  s.materials[0].emissivity_frac = 0.6;
  scene::Material soil = s.materials[0];
  soil.name = "soil";
  soil.layers = {{1.0, 1.0, 2000.0, 900.0}};
  soil.base_k = 288.0;
  s.materials.push_back(soil);
  s.thermal.surroundings_material = "soil";
  s.weather = {weather(700.0, 120.0, 320.0, 297.0)};
  s.weather[0].wind_m_s = 3.0;
  s.sensor.width_px = kWidth;
  s.sensor.height_px = kHeight;
  s.thermal.method = scene::ThermalMethod::cached;
  s.thermal.model = model;
  s.thermal.spin_up_ns = model == scene::ThermalModel::foster ? 24 * kHourNs : 0;
  s.thermal.steps = 27;
  s.thermal.spacing = scene::StepSpacing::geometric;
  return s;
}

/// Temperatures of the plate as seen from `from`, after frames over `seconds`.
std::vector<float> seen_k(renderer::Renderer& renderer, const glm::dvec3& from,
                          std::int64_t sim_time_ns) {
  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = sim_time_ns;
  request.sensor_pose = {from, physics::world_from_body_look_at(from, {0.0, 0.0, kUpM})};
  const int slot = renderer.submit(request);
  const auto& view = renderer.collect(static_cast<renderer::SlotIndex>(slot));
  EXPECT_FALSE(view.device_failed);
  EXPECT_EQ(view.stats.nonfinite_px, 0U);
  std::vector<float> out(view.temperature_k.begin(), view.temperature_k.end());
  renderer.release(static_cast<renderer::SlotIndex>(slot));
  return out;
}

std::unique_ptr<renderer::Renderer> renderer_of(const scene::ScenarioDesc& scenario) {
  renderer::OutputOptions output;
  output.temperature = true;
  auto made = renderer::Renderer::create(scenario, {}, output);
  if (!made) ADD_FAILURE() << made.error().text;
  return made ? std::move(*made) : nullptr;
}

float middle_k(const std::vector<float>& picture) {
  return picture[kHeight / 2 * kWidth + kWidth / 2];
}

/// Temperature of an open plate from the heat balance of both faces, in steps of a second.
double balance_k(const scene::ScenarioDesc& s, std::int64_t end_ns) {
  std::vector<std::int64_t> nodes_ns;
  for (std::int64_t t = 0; t <= end_ns; t += 60 * kSecondNs) nodes_ns.push_back(t);
  const auto intervals = renderer::surface_forcing(s, nodes_ns);
  EXPECT_TRUE(intervals.has_value());
  const scene::Material& m = s.materials[0];
  const double capacity = kSteel.thickness_m * kSteel.density_kg_m3 * kSteel.specific_heat_j_kg_k;
  const auto both_films_w_m2_k = [&m](const renderer::SurfaceForcing& f, double k) {
    const glm::dvec3 up(0.0, 0.0, 1.0);
    const physics::FilmSkin skin = scene::film_skin(m);
    return physics::film_w_m2_k(f.film, up, skin, k - f.air_k) +
           physics::film_w_m2_k(f.film, -up, skin, k - f.air_k);
  };
  double t_k = 300.0;  // has no influence after the first of two hours
  for (const renderer::IntervalForcing& interval : *intervals) {
    for (int i = 0; i < 60; ++i) {
      const renderer::SurfaceForcing& f = i < 30 ? interval.begin : interval.end;
      const double shortwave = f.sun_w_m2.z + f.diffuse_w_m2 + f.reflected_w_m2;
      const double longwave = f.longwave_w_m2 + f.environment_w_m2;
      const double out = 2.0 * physics::kStefanBoltzmannWPerM2K4 * std::pow(t_k, 4.0);
      t_k += (m.solar_absorptance_frac * shortwave + m.emissivity_frac * (longwave - out) +
              both_films_w_m2_k(f, t_k) * (f.air_k - t_k)) /
             capacity;
    }
  }
  return t_k;
}

TEST(RendererSheet, IsRefusedByNamePerFrameWithTheExtendedModelAlone) {
  auto scenario = plate(true, scene::ThermalModel::foster);
  scenario.thermal.method = scene::ThermalMethod::per_frame;
  const auto refused = renderer::Renderer::create(scenario, {}, {});
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, physics::ErrorCode::config);
  EXPECT_NE(refused.error().text.find("'" + scenario.materials[0].name + "' are sheets"),
            std::string::npos)
      << refused.error().text;
  // One-sided faces, thick ones and the published model have no such sheets.
  auto thick = scenario;
  thick.materials[0].layers = {{0.3, 1.0, 2000.0, 900.0}};
  EXPECT_TRUE(renderer::Renderer::create(thick, {}, {}).has_value());
  scenario.thermal.model = scene::ThermalModel::emit2014;
  scenario.thermal.spin_up_ns = 0;
  EXPECT_TRUE(renderer::Renderer::create(scenario, {}, {}).has_value());
}

TEST(RendererSheet, HasTheTemperatureOfABodyBetweenTwoFaces) {
  for (const bool faces_up : {true, false}) {
    const auto scenario = plate(faces_up, scene::ThermalModel::foster);
    const auto run = renderer_of(scenario);
    // Check the plate again after frames have advanced it from the warm-up.
    for (const std::int64_t now_ns : {2 * kHourNs, 2 * kHourNs + 90 * kSecondNs}) {
      const double expected_k = balance_k(scenario, now_ns);
      const float above_k = middle_k(seen_k(*run, {0.0, -3.0, kUpM + 4.0}, now_ns));
      const float below_k = middle_k(seen_k(*run, {0.0, -3.0, kUpM - 4.0}, now_ns));
      EXPECT_NEAR(above_k, expected_k, 0.1) << faces_up;
      EXPECT_NEAR(below_k, above_k, 2e-3) << faces_up;
    }
  }
}

TEST(RendererSheet, OfThePublishedModelFollowsBothFacesToo) {
  const auto at = [](bool faces_up) {
    const auto run = renderer_of(plate(faces_up, scene::ThermalModel::emit2014));
    const float above_k = middle_k(seen_k(*run, {0.0, -3.0, kUpM + 4.0}, 2 * kHourNs));
    const float below_k = middle_k(seen_k(*run, {0.0, -3.0, kUpM - 4.0}, 2 * kHourNs));
    EXPECT_NEAR(below_k, above_k, 2e-3);
    return above_k;
  };
  const float up_k = at(true);
  EXPECT_NEAR(up_k, at(false), 0.02);
  // Expect a temperature between those with the sun on both faces and on none.
  EXPECT_GT(up_k, 300.0F);
  EXPECT_LT(up_k, 350.0F);
}

TEST(RendererSheet, ShadeOnOneFaceShowsOnTheOther) {
  // Put a bar above the plate. Under it both faces lose the same heat.
  const auto scenario = plate(false, scene::ThermalModel::foster,
                              {{{-0.5, -9.0, kUpM + 1.0},
                                {0.5, -9.0, kUpM + 1.0},
                                {0.5, 9.0, kUpM + 1.0},
                                {-0.5, 9.0, kUpM + 1.0}}});
  const auto run = renderer_of(scenario);
  const auto below = seen_k(*run, {0.0, 0.1, kUpM - 6.0}, 2 * kHourNs);
  std::vector<float> row;  // from east to west through the centre
  for (std::uint32_t x = 0; x < kWidth; ++x) {
    const float k = below[kHeight / 2 * kWidth + x];
    if (!std::isnan(k)) row.push_back(k);
  }
  ASSERT_GT(row.size(), 40U);
  const auto [low, high] = std::ranges::minmax(row);
  EXPECT_GT(high - low, 6.0F);
  // Expect shade as wide as the bar, which is 1 m of the visible part of the plate.
  const double seen_m = 2.0 * 6.0 * std::tan(0.5 * scenario.sensor.fov_h_rad);
  const auto cool = std::ranges::count_if(row, [&](float k) { return k < 0.5F * (low + high); });
  EXPECT_NEAR(static_cast<double>(cool) / static_cast<double>(row.size()), 1.0 / seen_m, 0.02);
}

TEST(RendererSheet, WhatCoversAFaceLeavesTheOtherToDecide) {
  // Put a plate on the closed face of a block, with its front to the block or away from it.
  const auto on_block_k = [](bool faces_up) {
    auto scenario = plate(faces_up, scene::ThermalModel::foster);
    scene::ObjectDesc block = scenario.objects.front();
    block.name = "block";
    auto quads = box({-4.0, -4.0, kUpM - 2.0}, {4.0, 4.0, kUpM - 1e-4});
    quads.push_back({{-4.0, -4.0, kUpM - 2.0},
                     {-4.0, 4.0, kUpM - 2.0},
                     {4.0, 4.0, kUpM - 2.0},
                     {4.0, -4.0, kUpM - 2.0}});
    block.gltf = write_quads("block", quads);
    block.material = "soil";
    scenario.objects.push_back(block);
    return middle_k(seen_k(*renderer_of(scenario), {0.0, -3.0, kUpM + 4.0}, 2 * kHourNs));
  };
  const float front_up_k = on_block_k(true);
  EXPECT_NEAR(front_up_k, on_block_k(false), 0.1);
  EXPECT_GT(front_up_k, 310.0F);
}

TEST(RendererSheet, BothFacesCountInTheLimitOfSamples) {
  auto scenario = plate(true, scene::ThermalModel::foster,
                        {{{-0.5, -9.0, kUpM + 1.0},
                          {0.5, -9.0, kUpM + 1.0},
                          {0.5, 9.0, kUpM + 1.0},
                          {-0.5, 9.0, kUpM + 1.0}}});
  scenario.thermal.max_samples = 400;
  const auto run = renderer_of(scenario);
  (void)seen_k(*run, {0.0, -3.0, kUpM + 4.0}, 2 * kHourNs);
  EXPECT_LE(run->scene_stats().samples, 400U);
  EXPECT_GT(run->scene_stats().samples, 350U);
  EXPECT_TRUE(run->scene_stats().samples_full);
}

TEST(RendererSheet, OneThatIsNotThinKeepsItsBase) {
  auto scenario = plate(true, scene::ThermalModel::foster);
  scenario.materials[0].layers = {{0.05, 1.0, 2000.0, 900.0}};
  const auto run = renderer_of(scenario);
  const float hot_base_k = middle_k(seen_k(*run, {0.0, -3.0, kUpM + 4.0}, 2 * kHourNs));
  EXPECT_GT(hot_base_k, 325.0F);
}

}  // namespace
}  // namespace emit::test
