// SPDX-License-Identifier: Apache-2.0
// Tabulated and built-in air: every pixel of the shader against the table or the model in double
// precision.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/air_model.hpp"
#include "emit/physics/atmosphere_table.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/planck.hpp"
#include "support/renderer_scene.hpp"

namespace emit::test {
namespace {

constexpr double kSurfaceK = 350.0;

/// Table of air that varies with range and elevation in a way that no sum of exponentials does.
physics::AtmosphereGrid uneven_air() {
  physics::AtmosphereGrid grid;
  grid.range_m = {2.0, 5.0, 11.0, 40.0, 150.0, 900.0};
  for (const double deg : {-60.0, -25.0, -8.0, -1.0, 4.0, 12.0}) {
    grid.elevation_rad.push_back(deg * physics::kDegree);
    double tau = 1.0;
    double path = 0.0;
    for (std::size_t r = 0; r < grid.range_m.size(); ++r) {
      const double next =
          tau * (0.93 - 0.02 * std::abs(deg) / 60.0 - 0.03 * static_cast<double>(r));
      path += (tau - next) * (20.0 + 0.2 * deg + 3.0 * static_cast<double>(r));
      tau = next;
      grid.transmittance_frac.push_back(tau);
      grid.path_radiance_w_m2_sr.push_back(path);
    }
  }
  return grid;
}

struct Frame {
  std::vector<float> radiance;
  std::vector<float> depth_m;
  renderer::FrameStats stats;
};

Frame render(const scene::ScenarioDesc& scenario, const physics::Pose& pose) {
  renderer::OutputOptions output;
  output.depth = true;
  auto made = renderer::Renderer::create(scenario, {}, output);
  if (!made) {
    ADD_FAILURE() << made.error().text;
    return {};
  }
  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = 3'600'000'000'000;
  request.sensor_pose = pose;
  const int slot = (*made)->submit(request);
  const auto& view = (*made)->collect(static_cast<renderer::SlotIndex>(slot));
  EXPECT_FALSE(view.device_failed);
  return {{view.radiance_w_m2_sr[1].begin(), view.radiance_w_m2_sr[1].end()},
          {view.depth_m.begin(), view.depth_m.end()},
          view.stats};
}

/// Scenario with two bands, so that the table of the second does not start where that of the first
/// does.
scene::ScenarioDesc scenario_with(const physics::AtmosphereGrid& grid) {
  auto scenario = instant_scenario(write_quads("plane", {ground(200.0, 200.0)}));
  scenario.bands = {{"3-5", 3.0, 5.0, {}}, {"8-12", 8.0, 12.0, {}}};
  scenario.materials[0].prescribed_k = kSurfaceK;
  scenario.materials[0].band_emissivity = {{"3-5", 1.0}, {"8-12", 1.0}};
  scenario.atmosphere.enabled = true;
  scene::BandAtmosphere air;
  air.band = "8-12";
  air.table = grid;
  scenario.atmosphere.bands = {air};
  return scenario;
}

TEST(RendererAtmosphere, every_pixel_sees_the_tabulated_air_of_its_line_of_sight) {
  const auto grid = uneven_air();
  const auto scenario = scenario_with(grid);
  const auto table = physics::AtmosphereTable::build(grid);
  ASSERT_TRUE(table.has_value()) << table.error().text;
  const glm::dvec3 eye{0.0, -30.0, 4.0};
  const physics::Pose pose{eye, physics::world_from_body_look_at(eye, {0.0, 0.0, 3.0})};
  const Frame frame = render(scenario, pose);
  ASSERT_FALSE(frame.radiance.empty());
  const double leaving =
      physics::band_radiance({8.0, 12.0, {}}, physics::Kelvin(kSurfaceK)).radiance_w_m2_sr;
  std::uint32_t sky_px = 0;
  std::uint32_t surface_px = 0;
  std::uint32_t outside_px = 0;
  double worst = 0.0;
  for (std::uint32_t y = 0; y < 256; ++y) {
    for (std::uint32_t x = 0; x < 320; ++x) {
      const std::size_t i = y * 320 + x;
      const bool sky = std::isinf(frame.depth_m[i]);
      const glm::dvec3 ray =
          world_point(scenario.sensor, pose, x, y, sky ? 1.0 : frame.depth_m[i]) - eye;
      const double range_m = glm::length(ray);
      const double sine = ray.z / range_m;
      const auto air = sky ? table->out(sine) : table->along(range_m, sine);
      const double expected = sky ? air.path_radiance_w_m2_sr
                                  : air.transmittance_frac * leaving + air.path_radiance_w_m2_sr;
      worst = std::max(worst, std::abs(frame.radiance[i] / expected - 1.0));
      sky_px += sky ? 1U : 0U;
      surface_px += sky ? 0U : 1U;
      outside_px += air.clamped ? 1U : 0U;
    }
  }
  // Allow the relative error of in-band radiance in float32, 1e-4.
  EXPECT_LT(worst, 1e-4);
  EXPECT_GT(sky_px, 1000U);
  EXPECT_GT(surface_px, 20000U);
  // Leave room for pixels on the edge of the grid, which may fall to either side in float32.
  EXPECT_GT(outside_px, 1000U);
  EXPECT_NEAR(frame.stats.clamped_px, outside_px, 5.0);
  RecordProperty("worst_relative", std::to_string(worst));
}

TEST(RendererAtmosphere, every_pixel_sees_built_in_air_between_the_heights_of_camera_and_surface) {
  auto scenario = instant_scenario(write_quads("wide_plane", {ground(20000.0, 20000.0)}));
  scenario.bands = {{"3-5", 3.0, 5.0, {}}, {"8-12", 8.0, 12.0, {}}};
  scenario.materials[0].prescribed_k = kSurfaceK;
  scenario.materials[0].band_emissivity = {{"3-5", 1.0}, {"8-12", 1.0}};
  scenario.atmosphere.enabled = true;
  const physics::AirSpec spec{physics::AirClimate::us_standard, 23.0, 1.0};
  for (const auto& band : scenario.bands) {
    scene::BandAtmosphere air;
    air.band = band.name;
    air.model = spec;
    scenario.atmosphere.bands.push_back(air);
  }
  scenario.place.height_m = 150.0;
  const auto column = physics::AirColumn::build(spec);
  ASSERT_TRUE(column) << column.error().text;
  const auto terms = physics::BandAir::find("8-12");
  ASSERT_TRUE(terms);
  const double leaving =
      physics::band_radiance({8.0, 12.0, {}}, physics::Kelvin(kSurfaceK)).radiance_w_m2_sr;
  const double air_k = scenario.weather.at(0).air_k;
  const double warmer_k =
      (air_k - column->at(150.0).kelvin) * std::exp(150.0 / physics::BandAir::kWarmthScaleM);
  for (const double height_m : {4.0, 800.0, 6000.0}) {
    const glm::dvec3 eye{0.0, -30.0, height_m};
    const physics::Pose pose{eye,
                             physics::world_from_body_look_at(eye, {0.0, 4000.0, 0.9 * height_m})};
    const Frame frame = render(scenario, pose);
    ASSERT_FALSE(frame.radiance.empty());
    double worst_surface = 0.0;
    double worst_sky = 0.0;
    for (std::uint32_t y = 0; y < 256; y += 5) {
      for (std::uint32_t x = 0; x < 320; x += 20) {
        const std::size_t i = y * 320 + x;
        const bool sky = std::isinf(frame.depth_m[i]);
        const glm::dvec3 ray =
            world_point(scenario.sensor, pose, x, y, sky ? 1.0 : frame.depth_m[i]) - eye;
        const double range_m = glm::length(ray);
        const double sine = ray.z / range_m;
        if (sky) {
          if (sine < 0.01) continue;
          const auto path = physics::AirPath::to_space(*column, 150.0 + height_m, std::asin(sine));
          const double expected = terms->path_radiance_w_m2_sr(path, warmer_k);
          worst_sky = std::max(worst_sky, std::abs(frame.radiance[i] / expected - 1.0));
        } else {
          const auto path = physics::AirPath::between(*column, 150.0 + height_m, 150.0, range_m);
          const double expected =
              terms->transmittance(path, physics::AirSource::black_300k) * leaving +
              terms->path_radiance_w_m2_sr(path, warmer_k);
          worst_surface = std::max(worst_surface, std::abs(frame.radiance[i] / expected - 1.0));
        }
      }
    }
    // These are the errors of the table between its nodes, and of a surface of 350 K taken as one
    // of 300 K.
    EXPECT_LT(worst_surface, 0.02) << height_m;
    EXPECT_LT(worst_sky, 0.03) << height_m;
  }
}

TEST(RendererAtmosphere, nothing_is_counted_where_the_grid_covers_the_view) {
  physics::AtmosphereGrid grid;
  grid.range_m = {100.0, 100000.0};
  grid.elevation_rad = {-physics::kPi / 2, physics::kPi / 2};
  grid.transmittance_frac = {0.9, 0.1, 0.95, 0.2};
  grid.path_radiance_w_m2_sr = {2.0, 25.0, 1.0, 15.0};
  for (const glm::dvec3& at : {glm::dvec3{0.0, -30.0, 500.0}, glm::dvec3{0.0, -30.0, -500.0}}) {
    // Look straight up and straight down, where rounding must not leave the grid.
    const glm::dvec3 eye{0.0, -30.0, 4.0};
    const Frame frame =
        render(scenario_with(grid), {eye, physics::world_from_body_look_at(eye, at)});
    EXPECT_EQ(frame.stats.clamped_px, 0U);
    EXPECT_EQ(frame.stats.nonfinite_px, 0U);
  }
}

TEST(RendererAtmosphere, air_tables_too_large_for_any_device_are_refused) {
  physics::AtmosphereGrid grid;
  for (int i = 1; i <= 300; ++i) grid.range_m.push_back(i);
  for (int i = 0; i < 120; ++i) grid.elevation_rad.push_back(0.01 * i);
  grid.transmittance_frac.assign(300 * 120, 0.5);
  grid.path_radiance_w_m2_sr.assign(300 * 120, 1.0);
  const auto made = renderer::Renderer::create(scenario_with(grid), {}, {});
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, physics::ErrorCode::config);
  EXPECT_NE(made.error().text.find("65536"), std::string::npos) << made.error().text;
}

}  // namespace
}  // namespace emit::test
