// SPDX-License-Identifier: Apache-2.0
// Judges reflections in band against closed forms and sums over the hemisphere: hot neighbours, the
// sky by tilt, and a closed room.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "emit/physics/apparent_temperature.hpp"
#include "emit/physics/clear_sky.hpp"
#include "emit/physics/climate/climate.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/planck.hpp"
#include "support/renderer_scene.hpp"
#include "support/times.hpp"

namespace emit::test {
namespace {

const std::vector<scene::SpectralBand> kBands{{"3-5", 3.0, 5.0, {}}, {"8-12", 8.0, 12.0, {}}};

double black(const scene::SpectralBand& band, double kelvin) {
  return physics::band_radiance({band.lo_um, band.hi_um, {}}, physics::Kelvin(kelvin))
      .radiance_w_m2_sr;
}

/// Scenario with the product's thermal method at night, with faces that hold their temperature.
scene::ScenarioDesc held_scenario(const std::filesystem::path& gltf, double kelvin,
                                  double emissivity_frac) {
  scene::ScenarioDesc s = instant_scenario(gltf);
  s.bands = kBands;
  s.weather = {weather(0.0, 0.0, 200.0, 250.0)};
  s.materials[0].prescribed_k = kelvin;
  s.materials[0].emissivity_frac = emissivity_frac;
  s.materials[0].foster_modes = {};
  s.thermal.method = scene::ThermalMethod::cached;
  s.thermal.model = scene::ThermalModel::foster;
  s.thermal.spin_up_ns = 0;
  s.thermal.steps = 10;
  s.sensor.width_px = 64;
  s.sensor.height_px = 48;
  return s;
}

/// Planes of one frame.
struct Frame {
  std::vector<std::vector<float>> radiance;  ///< by band
  std::vector<float> depth_m;
  std::vector<float> temperature_k;
};

Frame shot(const scene::ScenarioDesc& scenario, const physics::Pose& pose,
           std::int64_t now_ns = 600 * kSecondNs) {
  renderer::OutputOptions output;
  output.depth = true;
  output.temperature = true;
  auto made = renderer::Renderer::create(scenario, {}, output);
  if (!made) {
    ADD_FAILURE() << made.error().text;
    return {};
  }
  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = now_ns;
  request.sensor_pose = pose;
  const int slot = (*made)->submit(request);
  EXPECT_GE(slot, 0);
  const auto& view = (*made)->collect(static_cast<renderer::SlotIndex>(slot));
  EXPECT_FALSE(view.device_failed);
  EXPECT_EQ(view.stats.nonfinite_px, 0U);
  Frame frame;
  for (const auto& plane : view.radiance_w_m2_sr) {
    frame.radiance.emplace_back(plane.begin(), plane.end());
  }
  frame.depth_m.assign(view.depth_m.begin(), view.depth_m.end());
  frame.temperature_k.assign(view.temperature_k.begin(), view.temperature_k.end());
  return frame;
}

physics::Pose look(const glm::dvec3& from_m, const glm::dvec3& to_m) {
  return {from_m, physics::world_from_body_look_at(from_m, to_m)};
}

TEST(Reflection, AFloorShowsTheHotWallBesideIt) {
  constexpr double kWallM = 3.0;
  constexpr double kWallK = 600.0;
  for (const double emissivity_frac : {0.1, 0.5, 0.9}) {
    // The wall stands on the floor's western edge, and is far longer than it is high.
    auto scenario = held_scenario(
        write_quads(
            "floor",
            {{{0.0, -300.0, 0.0}, {40.0, -300.0, 0.0}, {40.0, 300.0, 0.0}, {0.0, 300.0, 0.0}}}),
        kWallK, emissivity_frac);
    scene::Material hot = scenario.materials[0];
    hot.name = "hot";
    scenario.materials[0].prescribed_k.reset();
    hot.emissivity_frac = 1.0;
    scenario.materials.push_back(hot);
    scene::ObjectDesc wall = scenario.objects[0];
    wall.name = "wall";
    wall.material = "hot";
    wall.gltf = write_quads(
        "wall",
        {{{0.0, -300.0, 0.0}, {0.0, 300.0, 0.0}, {0.0, 300.0, kWallM}, {0.0, -300.0, kWallM}}});
    scenario.objects.push_back(wall);
    const physics::Pose pose = look({4.0, -0.1, 6.0}, {4.0, 0.0, 0.0});
    const Frame frame = shot(scenario, pose);
    ASSERT_EQ(frame.radiance.size(), kBands.size());
    std::size_t compared = 0;
    for (std::size_t b = 0; b < kBands.size(); ++b) {
      double worst = 0.0;
      for (std::uint32_t y = 0; y < 48; ++y) {
        for (std::uint32_t x = 0; x < 64; ++x) {
          const std::size_t i = y * 64 + x;
          const glm::dvec3 at_m = world_point(scenario.sensor, pose, x, y, frame.depth_m[i]);
          if (std::abs(at_m.z) > 0.01 || at_m.x < 0.3) continue;
          // A band of infinite length fills that share of the hemisphere of a level face beside it.
          const double wall_frac = 0.5 * (1.0 - at_m.x / std::hypot(at_m.x, kWallM));
          const double expected = emissivity_frac * black(kBands[b], frame.temperature_k[i]) +
                                  (1.0 - emissivity_frac) * wall_frac * black(kBands[b], kWallK);
          worst = std::max(worst, std::abs(frame.radiance[b][i] / expected - 1.0));

          ++compared;
        }
      }
      EXPECT_LT(worst, 0.01) << kBands[b].name << ", emissivity " << emissivity_frac;
      RecordProperty(kBands[b].name + std::to_string(emissivity_frac), std::to_string(worst));
    }
    EXPECT_GT(compared, 2000U);
  }
}

/// Share of the hemisphere of a level face that a level rectangle above it fills, from its height
/// and the distances of its edges: the closed form for a rectangle with a corner overhead, summed
/// over its four corners.
double overhead_frac(double up_m, double west_m, double east_m, double south_m, double north_m) {
  const auto corner = [&](double x_m, double y_m) {
    const double x = x_m / up_m;
    const double y = y_m / up_m;
    const double u = std::hypot(1.0, x);
    const double v = std::hypot(1.0, y);
    return (x / u * std::atan(y / u) + y / v * std::atan(x / v)) / (2.0 * physics::kPi);
  };
  return corner(east_m, north_m) - corner(west_m, north_m) - corner(east_m, south_m) +
         corner(west_m, south_m);
}

TEST(Reflection, GroundBesideAHotSquareHasTheTemperatureOfItsBalance) {
  constexpr double kHotK = 800.0;
  constexpr double kUpM = 1.5;
  constexpr double kBaseK = 260.0;
  constexpr double kFilm = 12.0;
  constexpr double kSkyW_m2 = 200.0;
  const scene::Layer foam{0.03, 0.03, 30.0, 1000.0};
  auto scenario = held_scenario(
      write_quads(
          "plain",
          {{{-60.0, -60.0, 0.0}, {60.0, -60.0, 0.0}, {60.0, 60.0, 0.0}, {-60.0, 60.0, 0.0}}}),
      kHotK, 1.0);
  scene::Material hot = scenario.materials[0];
  hot.name = "hot";
  scene::Material& ground = scenario.materials[0];
  ground.prescribed_k.reset();
  ground.emissivity_frac = 0.9;
  ground.layers = {foam};
  ground.modes.clear();
  ground.base_k = kBaseK;
  scenario.weather[0].film_w_m2_k = kFilm;
  scenario.materials.push_back(hot);
  scene::ObjectDesc square = scenario.objects[0];
  square.name = "square";
  square.material = "hot";
  // The square looks down.
  square.gltf = write_quads(
      "square", {{{-0.5, -0.5, kUpM}, {-0.5, 0.5, kUpM}, {0.5, 0.5, kUpM}, {0.5, -0.5, kUpM}}});
  scenario.objects.push_back(square);
  scenario.thermal.lateral = false;
  scenario.thermal.history_start_ns = -8 * 3600 * kSecondNs;
  scenario.thermal.steps = 30;
  scenario.thermal.spacing = scene::StepSpacing::geometric;
  scenario.sensor.width_px = 128;
  scenario.sensor.height_px = 96;
  const double black_w_m2 = physics::kStefanBoltzmannWPerM2K4;
  const auto truth_k = [&](double square_frac) {
    const double in_w_m2 =
        (1.0 - square_frac) * kSkyW_m2 + square_frac * black_w_m2 * std::pow(kHotK, 4.0);
    double low = 100.0;
    double high = 800.0;
    for (int i = 0; i < 60; ++i) {
      const double t = 0.5 * (low + high);
      const double gained = 0.9 * (in_w_m2 - black_w_m2 * std::pow(t, 4.0)) +
                            kFilm * (scenario.weather[0].air_k - t) +
                            foam.conductivity_w_m_k / foam.thickness_m * (kBaseK - t);
      (gained > 0.0 ? low : high) = t;
    }
    return low;
  };
  double worst_k = 0.0;
  double hottest_k = 0.0;
  double farthest_m = 0.0;
  std::size_t over = 0;
  std::size_t compared = 0;
  for (const physics::Pose& pose :
       {look({0.0, -6.0, 4.0}, {0.0, 0.5, 0.0}), look({0.0, -30.0, 8.0}, {0.0, -8.0, 0.0})}) {
    const Frame frame = shot(scenario, pose);
    ASSERT_EQ(frame.temperature_k.size(), 128U * 96U);
    for (std::uint32_t y = 0; y < 96; ++y) {
      for (std::uint32_t x = 0; x < 128; ++x) {
        const std::size_t i = y * 128 + x;
        const glm::dvec3 at_m = world_point(scenario.sensor, pose, x, y, frame.depth_m[i]);
        const double away_m = std::hypot(at_m.x, at_m.y);
        if (!(std::abs(at_m.z) < 0.01) || away_m < 0.7 || away_m > 20.0) continue;
        const double expected_k =
            truth_k(overhead_frac(kUpM, -0.5 - at_m.x, 0.5 - at_m.x, -0.5 - at_m.y, 0.5 - at_m.y));
        const double off_k = std::abs(frame.temperature_k[i] - expected_k);
        if (off_k > 0.3) ++over;
        worst_k = std::max(worst_k, off_k);
        hottest_k = std::max(hottest_k, expected_k);
        farthest_m = std::max(farthest_m, away_m);
        ++compared;
      }
    }
  }
  RecordProperty("worst_k", std::to_string(worst_k));
  EXPECT_GT(compared, 5000U);
  EXPECT_GT(hottest_k, truth_k(0.0) + 50.0);
  EXPECT_GT(farthest_m, 19.0);
  // Triangles between samples bend where the temperature changes by 40 K in a metre.
  EXPECT_LT(1000 * over, compared);
  EXPECT_LT(worst_k, 0.5);
}

TEST(Reflection, AClosedRoomOfOneTemperatureShowsABlackbody) {
  constexpr double kRoomK = 320.0;
  for (const double emissivity_frac : {0.1, 0.6}) {
    // Turn the faces of a box inwards.
    std::vector<Quad> room = box({-2.0, -1.5, 0.0}, {2.0, 1.5, 2.5});
    for (Quad& quad : room) std::swap(quad.b, quad.d);
    room.push_back(ground(2.0, 1.5));
    const auto scenario = held_scenario(write_quads("room", room), kRoomK, emissivity_frac);
    for (const glm::dvec3& to_m :
         {glm::dvec3(2.0, 1.5, 0.0), glm::dvec3(-2.0, -1.5, 2.5), glm::dvec3(0.1, 0.0, 0.0)}) {
      const Frame frame = shot(scenario, look({0.0, 0.0, 1.2}, to_m));
      ASSERT_EQ(frame.radiance.size(), kBands.size());
      for (std::size_t b = 0; b < kBands.size(); ++b) {
        for (const float radiance : frame.radiance[b]) {
          ASSERT_NEAR(radiance / black(kBands[b], kRoomK), 1.0, 2e-4)
              << kBands[b].name << ", emissivity " << emissivity_frac;
        }
      }
    }
  }
}

TEST(Reflection, ATiltedPanelReflectsTheSkyBeforeIt) {
  constexpr double kPanelK = 295.0;
  constexpr double kEmissivity = 0.1;
  const physics::ApparentTemperature apparent({8.0, 12.0, {}});
  for (const double vertical_frac : {0.95, 0.8, 0.5}) {
    for (const double tilt_deg : {0.0, 20.0, 45.0, 70.0, 90.0, 120.0, 150.0}) {
      const double tilt = tilt_deg * physics::kDegree;
      const glm::dvec3 normal(std::sin(tilt), 0.0, std::cos(tilt));
      const glm::dvec3 u(std::cos(tilt), 0.0, -std::sin(tilt));
      const glm::dvec3 v(0.0, 1.0, 0.0);
      const glm::dvec3 centre(0.0, 0.0, 50.0);
      auto scenario = held_scenario(
          write_quads("panel", {{centre - u - v, centre + u - v, centre + u + v, centre - u + v}}),
          kPanelK, kEmissivity);
      scenario.bands = {{"8-12", 8.0, 12.0, {}}};
      scenario.atmosphere.enabled = true;
      scene::BandAtmosphere air;
      air.band = "8-12";
      air.terms = {{1.0, 0.0}};
      air.vertical_transmittance_frac = vertical_frac;
      scenario.atmosphere.bands = {air};
      // Find the long-wave irradiance with which the sky is clear and as warm as the air.
      scenario.weather[0].air_k = 290.0;
      scenario.weather[0].environment_k = 280.0;
      scenario.weather[0].longwave_down_w_m2 = physics::sky_longwave_w_m2(
          physics::Kelvin(290.0), physics::Kelvin(physics::usual_dew_point_k(290.0)), 0.0, {});
      const Frame frame =
          shot(scenario, look(centre + 5.0 * normal + glm::dvec3(0.0, 0.01, 0.0), centre));
      ASSERT_EQ(frame.radiance.size(), 1U);
      // Sum sky and ground over the hemisphere before the panel.
      const double sky_w_m2_sr = black(scenario.bands[0], 290.0);
      const double ground_w_m2_sr = black(scenario.bands[0], 280.0);
      double incoming = 0.0;
      constexpr int kRings = 900;
      constexpr int kSectors = 360;
      for (int i = 0; i < kRings; ++i) {
        const double sine = -1.0 + 2.0 * (i + 0.5) / kRings;
        const double across = std::sqrt(1.0 - sine * sine);
        const double mass =
            sine > 0.0 ? physics::relative_air_mass(physics::Radians(std::asin(sine))) : 0.0;
        const double radiance =
            sine > 0.0 ? sky_w_m2_sr * (1.0 - std::pow(vertical_frac, mass)) : ground_w_m2_sr;
        for (int k = 0; k < kSectors; ++k) {
          const double azimuth = 2.0 * physics::kPi * (k + 0.5) / kSectors;
          const double cosine = normal.x * across * std::cos(azimuth) + normal.z * sine;
          incoming += std::max(0.0, cosine) * radiance * 4.0 / kRings / kSectors;
        }
      }
      const double expected_k = apparent.k(static_cast<float>(
          kEmissivity * black(scenario.bands[0], kPanelK) + (1.0 - kEmissivity) * incoming));
      const float shown = frame.radiance[0][24 * 64 + 32];
      EXPECT_NEAR(apparent.k(shown), expected_k, 0.2)
          << tilt_deg << " degrees, vertical transmittance " << vertical_frac;
    }
  }
}

/// Scenario of two faces at right angles that warm up after sunrise and reflect each other.
scene::ScenarioDesc corner() {
  auto s = held_scenario(
      write_quads("corner",
                  {ground(3.0, 3.0),
                   {{-3.0, 3.0, 0.0}, {3.0, 3.0, 0.0}, {3.0, 3.0, 4.0}, {-3.0, 3.0, 4.0}}}),
      300.0, 0.3);
  s.materials[0].prescribed_k.reset();
  s.weather = {weather(700.0, 80.0, 300.0, 285.0)};
  s.thermal.steps = 90;
  return s;
}

TEST(Reflection, DoesNotDependOnTheFrames) {
  const scene::ScenarioDesc scenario = corner();
  const auto at_the_end = [&](std::int64_t frame_s) {
    auto made = renderer::Renderer::create(scenario, {}, {});
    EXPECT_TRUE(made) << made.error().text;
    std::vector<float> out;
    for (std::int64_t now_s = 3600;; now_s = std::min<std::int64_t>(now_s + frame_s, 5400)) {
      renderer::FrameRequest request;
      request.sim_time_ns = request.thermal_time_ns = now_s * kSecondNs;
      request.sensor_pose = look({1.0, -8.0, 3.0}, {0.0, 2.0, 1.0});
      const auto slot = static_cast<renderer::SlotIndex>((*made)->submit(request));
      const auto& view = (*made)->collect(slot);
      out.assign(view.radiance_w_m2_sr[0].begin(), view.radiance_w_m2_sr[0].end());
      (*made)->release(slot);
      if (now_s == 5400) return out;
    }
  };
  const std::vector<float> seldom = at_the_end(97);
  const std::vector<float> often = at_the_end(7);
  ASSERT_EQ(seldom.size(), often.size());
  EXPECT_EQ(seldom, often);
}

TEST(Reflection, GoesOnAsAWarmUpHasIt) {
  const scene::ScenarioDesc scenario = corner();
  // Returns what arrives at each pixel in 3-5 um: its radiance without its own emission.
  const auto arrives = [&](std::int64_t from_s) {
    renderer::OutputOptions output;
    output.temperature = true;
    auto made = renderer::Renderer::create(scenario, {}, output);
    EXPECT_TRUE(made) << made.error().text;
    std::vector<double> out;
    for (std::int64_t now_s = from_s; now_s <= 7200; now_s += 30) {
      renderer::FrameRequest request;
      request.sim_time_ns = request.thermal_time_ns = now_s * kSecondNs;
      request.sensor_pose = look({1.0, -8.0, 3.0}, {0.0, 2.0, 1.0});
      const auto slot = static_cast<renderer::SlotIndex>((*made)->submit(request));
      const auto& view = (*made)->collect(slot);
      out.clear();
      for (std::size_t i = 0; i < view.temperature_k.size(); ++i) {
        const double kelvin = view.temperature_k[i];
        if (std::isnan(kelvin)) continue;
        out.push_back((view.radiance_w_m2_sr[0][i] - 0.3 * black(kBands[0], kelvin)) / 0.7);
      }
      (*made)->release(slot);
    }
    return out;
  };
  const std::vector<double> run = arrives(5400);
  const std::vector<double> anew = arrives(7200);
  ASSERT_EQ(run.size(), anew.size());
  ASSERT_GT(run.size(), 1000U);
  // The two warm-ups place their samples differently, which shows in the corner: there what a face
  // sees of the other one bends within a sample's distance. A hundredth is a third of a kelvin.
  std::vector<double> off;
  for (std::size_t i = 0; i < run.size(); ++i) off.push_back(std::abs(run[i] / anew[i] - 1.0));
  std::ranges::sort(off);
  EXPECT_LT(off[off.size() / 2], 0.003);
  EXPECT_LT(off[off.size() * 9 / 10], 0.03);
  RecordProperty("p50", std::to_string(off[off.size() / 2]));
  RecordProperty("p90", std::to_string(off[off.size() * 9 / 10]));
}

}  // namespace
}  // namespace emit::test
