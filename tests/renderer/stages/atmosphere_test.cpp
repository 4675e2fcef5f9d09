// SPDX-License-Identifier: Apache-2.0
// Tabulated and built-in air: every pixel of the shader against the table or the model in double
// precision.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <span>

#include "emit/physics/air_model.hpp"
#include "emit/physics/apparent_temperature.hpp"
#include "emit/physics/atmosphere_table.hpp"
#include "emit/physics/clear_sky.hpp"
#include "emit/physics/climate/climate.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/planck.hpp"
#include "emit/physics/sky/sun_scatter.hpp"
#include "emit/physics/sun.hpp"
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
  // The weather's long-wave irradiance is that of a clear sky.
  scenario.weather[0].longwave_down_w_m2 = physics::sky_longwave_w_m2(
      physics::Kelvin(scenario.weather[0].air_k),
      physics::Kelvin(physics::usual_dew_point_k(scenario.weather[0].air_k)), 0.0);
  const auto column = physics::AirColumn::build(spec);
  ASSERT_TRUE(column) << column.error().text;
  const auto terms = physics::BandAir::build({8.0, 12.0, {}});
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

TEST(RendererAtmosphere, air_scatters_sunlight_by_day_and_none_by_night) {
  auto scenario = instant_scenario(write_quads("wide_plane", {ground(20000.0, 20000.0)}));
  scenario.bands = {{"3-5", 3.0, 5.0, {}}, {"8-12", 8.0, 12.0, {}}};
  scenario.materials[0].prescribed_k = 300.0;
  scenario.materials[0].band_emissivity = {{"3-5", 1.0}, {"8-12", 1.0}};
  scenario.atmosphere.enabled = true;
  const physics::AirSpec spec{physics::AirClimate::us_standard, 10.0, 1.0};
  for (const auto& band : scenario.bands) {
    scene::BandAtmosphere air;
    air.band = band.name;
    air.model = spec;
    scenario.atmosphere.bands.push_back(air);
  }
  scenario.place.height_m = 150.0;
  scenario.weather[0].longwave_down_w_m2 = physics::sky_longwave_w_m2(
      physics::Kelvin(scenario.weather[0].air_k),
      physics::Kelvin(physics::usual_dew_point_k(scenario.weather[0].air_k)), 0.0);
  const auto column = physics::AirColumn::build(spec);
  ASSERT_TRUE(column) << column.error().text;
  const physics::Band midwave{3.0, 5.0, {}};
  const auto scatter = physics::SunScatter::build(*column, midwave);
  ASSERT_TRUE(scatter);
  const auto emission = *physics::BandAir::build(midwave);
  const double warmer_k = (scenario.weather[0].air_k - column->at(150.0).kelvin) *
                          std::exp(150.0 / physics::BandAir::kWarmthScaleM);
  renderer::OutputOptions output;
  output.depth = output.temperature = output.sun = output.sky = output.terms = true;
  auto made = renderer::Renderer::create(scenario, {}, output);
  ASSERT_TRUE(made) << made.error().text;
  const physics::GeoPlace place{physics::Radians(scenario.place.lat_rad),
                                physics::Radians(scenario.place.lon_rad), physics::Metres(150.0)};
  double brightest = 0.0;
  for (const double hours : {2.0, 15.0}) {
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = std::llround(hours * 3.6e12);
    const physics::SunPosition sun =
        physics::sun_position(scenario.epoch_utc_ns + request.sim_time_ns, place);
    const bool day = sun.elevation.value() > 0.0;
    ASSERT_EQ(day, hours < 12.0);
    const double share =
        physics::beam_share_frac(scenario.weather[0].direct_normal_w_m2, sun, place.height,
                                 scenario.clear_sky.linke_turbidity) /
        (sun.distance_au * sun.distance_au);
    const double sun_rad = std::max(0.0, physics::apparent_elevation(sun.elevation).value());
    const auto beams = scatter->beams(*column, std::span(&sun_rad, 1));
    // Look past the sun, so that sky and ground are in view.
    const glm::dvec3 eye{0.0, 0.0, 30.0};
    const glm::dvec3 ahead =
        glm::normalize(glm::dvec3(sun.direction_enu.x, sun.direction_enu.y, 0.05));
    request.sensor_pose = {eye, physics::world_from_body_look_at(eye, eye + ahead)};
    const int slot = (*made)->submit(request);
    const auto& view = (*made)->collect(static_cast<renderer::SlotIndex>(slot));
    double worst = 0.0;
    for (std::uint32_t y = 0; y < 256; y += 15) {
      for (std::uint32_t x = 0; x < 320; x += 40) {
        const std::size_t i = y * 320 + x;
        const auto parts = (*made)->radiance_terms(view, {x, y}, 1.0);
        EXPECT_NEAR(parts[0].sum_w_m2_sr(), view.radiance_w_m2_sr[0][i],
                    1e-4 * view.radiance_w_m2_sr[0][i]);
        EXPECT_EQ(parts[1].scattered_w_m2_sr, 0.0);
        EXPECT_EQ(parts[0].scattered_w_m2_sr > 0.0, day);
        brightest = std::max(brightest, parts[0].scattered_w_m2_sr / parts[0].path_w_m2_sr);
        const bool sky = std::isinf(view.depth_m[i]);
        const glm::dvec3 ray =
            world_point(scenario.sensor, request.sensor_pose, x, y, sky ? 1.0 : view.depth_m[i]) -
            eye;
        const double range_m = glm::length(ray);
        const double sine = ray.z / range_m;
        if (sky && sine < 0.01) continue;
        const auto path = sky ? physics::AirPath::to_space(*column, 180.0, std::asin(sine))
                              : physics::AirPath::between(*column, 180.0, 180.0 + ray.z, range_m);
        physics::SunScatter::Kinds light{};
        if (day) scatter->scattered_w_m2(path, beams, std::span(&light, 1));
        const auto phase = scatter->phase_per_sr(glm::dot(ray / range_m, sun.direction_enu));
        double expected = 0.0;
        for (std::size_t k = 0; k < light.size(); ++k) expected += share * light[k] * phase[k];
        const double all = expected + emission.path_radiance_w_m2_sr(path, warmer_k);
        worst = std::max(worst, std::abs(parts[0].scattered_w_m2_sr - expected) / all);
      }
    }
    EXPECT_LT(worst, 0.02) << hours;
  }
  EXPECT_GT(brightest, 0.1);
}

/// Overcast over a metal of emissivity 0.1 by night, in one band.
scene::ScenarioDesc overcast(const scene::SpectralBand& band, double sky_k,
                             const physics::CloudBase& base) {
  auto scenario = instant_scenario(write_quads("wide_plane", {ground(20000.0, 20000.0)}));
  scenario.bands = {{"3.4-4.1", 3.4, 4.1, {}}, band};
  scenario.materials[0].prescribed_k = 310.0;
  scenario.materials[0].emissivity_frac = 0.1;
  scenario.atmosphere.enabled = true;
  for (const auto& each : scenario.bands) {
    scene::BandAtmosphere air;
    air.band = each.name;
    air.model = physics::AirSpec{physics::AirClimate::midlatitude_summer, 23.0, 1.0};
    scenario.atmosphere.bands.push_back(air);
  }
  scenario.clear_sky.cloud_base = base;
  scenario.weather[0].direct_normal_w_m2 = 0.0;
  scenario.weather[0].longwave_down_w_m2 = physics::kStefanBoltzmannWPerM2K4 * std::pow(sky_k, 4.0);
  return scenario;
}

TEST(RendererAtmosphere, an_overcast_sky_is_its_base_behind_the_air) {
  const double air_k = 295.0;
  const double clear_frac =
      physics::sky_emissivity_frac(physics::Kelvin(physics::usual_dew_point_k(air_k)), 0.0);
  // A base of no stated height is as warm as eq. 12 says, and where the air cools to that.
  const auto free_base_k = [&](double sky_k) {
    return std::pow((std::pow(sky_k, 4.0) - clear_frac * std::pow(air_k, 4.0)) / (1.0 - clear_frac),
                    0.25);
  };
  struct Case {
    const char* name;
    double sky_k;
    double cloud_frac;
    physics::CloudBase base;
    double base_k;
    double warmer_k = 0.0;
  };
  // A low base; a sky that only clouds can be as warm as; one that eq. 12 would take for partly
  // clear but whose weather states the clouds; and air above that is warmer than at the ground.
  const double low_k = air_k - 0.0065 * 200.0;
  const double low_sky_k =
      std::pow(clear_frac * std::pow(air_k, 4.0) + (1.0 - clear_frac) * std::pow(low_k, 4.0), 0.25);
  const std::vector<Case> cases{{"low", low_sky_k, 0.0, {.height_m = 200.0}, low_k},
                                {"usual", 293.5, 0.0, {}, free_base_k(293.5)},
                                {"stated", 288.0, 1.0, {}, free_base_k(288.0)},
                                {"inversion", 297.0, 0.0, {}, 297.0, 2.0}};
  const std::vector<scene::SpectralBand> bands{{"3-5", 3.0, 5.0, {}}, {"8-12", 8.0, 12.0, {}}};
  for (const scene::SpectralBand& band : bands) {
    const physics::Band flat{band.lo_um, band.hi_um, {}};
    const auto black = [&flat](double kelvin) {
      return physics::band_radiance(flat, physics::Kelvin(kelvin)).radiance_w_m2_sr;
    };
    const auto column =
        physics::AirColumn::build({physics::AirClimate::midlatitude_summer, 23.0, 1.0});
    const auto air = physics::BandAir::build(flat);
    ASSERT_TRUE(column && air);
    for (const Case& each : cases) {
      SCOPED_TRACE(band.name + std::string(" ") + each.name);
      auto scenario = overcast(band, each.sky_k, each.base);
      scenario.weather[0].cloud_frac = each.cloud_frac;
      const double place_m = scenario.place.height_m;
      const double base_m =
          each.base.height_m.value_or(std::max((air_k - each.base_k) / 0.0065, 100.0));
      const double warmer_k = (air_k - column->at(place_m).kelvin + each.warmer_k) *
                              std::exp(place_m / physics::BandAir::kWarmthScaleM);
      const auto expected = [&](double above_m, double sine) {
        constexpr double kEarthM = 6371000.0;
        const double up_m = base_m - above_m;
        const double range_m =
            std::sqrt(std::pow(kEarthM * sine, 2.0) + up_m * (2.0 * kEarthM + up_m)) -
            kEarthM * sine;
        const auto way =
            physics::AirPath::between(*column, place_m + above_m, place_m + base_m, range_m);
        return air->transmittance(way, physics::AirSource::black_300k) * black(each.base_k) +
               air->path_radiance_w_m2_sr(way, warmer_k);
      };
      const glm::dvec3 eye{0.0, -30.0, 4.0};
      const physics::ApparentTemperature apparent(flat);
      const auto pose = [&](double up_m) {
        return physics::Pose{eye, physics::world_from_body_look_at(eye, {0.0, 0.0, eye.z + up_m})};
      };
      const Frame up = render(scenario, pose(30.0));
      double worst_k = 0.0;
      for (std::uint32_t i = 0; i < up.radiance.size(); i += 37) {
        ASSERT_TRUE(std::isinf(up.depth_m[i]));
        const glm::dvec3 ray =
            world_point(scenario.sensor, pose(30.0), i % 320, i / 320, 1.0) - eye;
        const double sine = ray.z / glm::length(ray);
        worst_k = std::max(
            worst_k,
            std::abs(static_cast<double>(apparent.k(up.radiance[i]) -
                                         apparent.k(static_cast<float>(expected(eye.z, sine))))));
      }
      EXPECT_LT(worst_k, 0.4);
      // The metal reflects the mean of that sky. The air before it, of some ten metres, is left
      // out.
      double mean = 0.0;
      for (int i = 0; i < 200; ++i) {
        const double sine = (i + 0.5) / 200.0;
        mean += 2.0 * sine / 200.0 * expected(0.0, sine);
      }
      const double metal_k = apparent.k(static_cast<float>(0.1 * black(310.0) + 0.9 * mean));
      const Frame down = render(scenario, pose(-30.0));
      double metal_worst_k = 0.0;
      for (std::size_t i = 0; i < down.radiance.size(); ++i) {
        ASSERT_FALSE(std::isinf(down.depth_m[i]));
        metal_worst_k = std::max(metal_worst_k, std::abs(apparent.k(down.radiance[i]) - metal_k));
      }
      EXPECT_LT(metal_worst_k, 1.2);
      std::printf(
          "%s %s: base %.1f K at %.0f m, overhead %.1f K, long-wave sky %.1f K; off by "
          "%.2f K, metal by %.2f K\n",
          band.name.c_str(), each.name, each.base_k, base_m,
          static_cast<double>(apparent.k(static_cast<float>(expected(0.0, 1.0)))), each.sky_k,
          worst_k, metal_worst_k);
    }
  }
}

TEST(RendererAtmosphere, the_sky_over_all_wavelengths_sends_the_long_wave_irradiance) {
  // Grey air: all bands together are the whole spectrum. Its emissivity is that of eq. 12.
  auto scenario = instant_scenario(write_quads("plane", {ground(200.0, 200.0)}));
  scenario.bands = {{"short", 0.5, 8.0, {}}, {"8-12", 8.0, 12.0, {}}, {"long", 12.0, 100.0, {}}};
  const double air_k = scenario.weather[0].air_k;
  const double dew_k = physics::usual_dew_point_k(air_k);
  const double clear_frac = physics::sky_emissivity_frac(physics::Kelvin(dew_k), 0.0);
  const auto hemisphere = [](double vertical_frac) {
    double sum = 0.0;
    for (int i = 0; i < 900; ++i) {
      const double elevation = (i + 0.5) / 900.0 * physics::kPi / 2.0;
      const double mass = physics::relative_air_mass(physics::Radians(elevation));
      sum += (1.0 - std::pow(vertical_frac, mass)) * std::sin(2.0 * elevation) * physics::kPi /
             2.0 / 900.0;
    }
    return sum;
  };
  double low = 0.0;
  double high = 1.0;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (hemisphere(middle) > clear_frac ? low : high) = middle;
  }
  scenario.atmosphere.enabled = true;
  for (const auto& band : scenario.bands) {
    scene::BandAtmosphere air;
    air.band = band.name;
    air.terms = {{1.0, 1e-4}};
    air.vertical_transmittance_frac = low;
    scenario.atmosphere.bands.push_back(air);
  }
  // One column of pixels sees the sky from the horizon to beyond the zenith.
  scenario.sensor.width_px = 8;
  scenario.sensor.height_px = 800;
  scenario.sensor.fov_h_rad = 2.0 * std::atan(8.0 / 800.0 * std::tan(50.0 * physics::kDegree));
  const glm::dvec3 eye{0.0, 0.0, 4.0};
  const physics::Pose pose{eye, physics::world_from_body_look_at(eye, eye + glm::dvec3{1, 0, 1})};
  for (const double longwave_w_m2 : {300.0, 372.0, 400.0, 428.0, 450.0}) {
    scenario.weather[0].longwave_down_w_m2 = longwave_w_m2;
    renderer::OutputOptions output;
    auto made = renderer::Renderer::create(scenario, {}, output);
    ASSERT_TRUE(made) << made.error().text;
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = 3'600'000'000'000;
    request.sensor_pose = pose;
    const int slot = (*made)->submit(request);
    const auto& view = (*made)->collect(static_cast<renderer::SlotIndex>(slot));
    // Add up radiance times the cosine to the zenith over the rings between pixels.
    double sent_w_m2 = 0.0;
    double covered_frac = 0.0;
    const auto sine_at = [&](double y) {
      const double tan_v = std::tan(50.0 * physics::kDegree);
      return std::sin(45.0 * physics::kDegree + std::atan((1.0 - 2.0 * y / 800.0) * tan_v));
    };
    for (std::uint32_t y = 0; y < 800; ++y) {
      const double angle = 45.0 * physics::kDegree +
                           std::atan((1.0 - 2.0 * y / 800.0) * std::tan(50.0 * physics::kDegree));
      if (angle > physics::kPi / 2.0 || sine_at(y + 1.0) < 0.0) continue;
      const double share = sine_at(y) * sine_at(y) - sine_at(y + 1.0) * sine_at(y + 1.0);
      covered_frac += share;
      for (std::size_t b = 0; b < 3; ++b) {
        sent_w_m2 += physics::kPi * share * view.radiance_w_m2_sr[b][y * 8 + 4];
      }
    }
    EXPECT_GT(covered_frac, 0.999);
    EXPECT_NEAR(sent_w_m2, longwave_w_m2, 0.01 * longwave_w_m2);
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
