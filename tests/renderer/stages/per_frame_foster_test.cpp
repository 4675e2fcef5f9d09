// SPDX-License-Identifier: Apache-2.0
// The extended thermal model per pixel against the same model in double precision.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/physics/foster.hpp"
#include "history/foster_history.hpp"
#include "support/renderer_scene.hpp"

namespace emit::test {
namespace {

constexpr std::int64_t kHourNs = 3'600'000'000'000;
using physics::kReferenceK;
constexpr std::uint32_t kWidth = 320;
constexpr std::uint32_t kHeight = 256;

std::vector<float> render_k(const scene::ScenarioDesc& scenario, const physics::Pose& pose,
                            std::int64_t sim_time_ns) {
  renderer::OutputOptions output;
  output.temperature = true;
  auto made = renderer::Renderer::create(scenario, {}, output);
  if (!made) {
    ADD_FAILURE() << made.error().text;
    return std::vector<float>(kWidth * kHeight);
  }
  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = sim_time_ns;
  request.sensor_pose = pose;
  const int slot = (*made)->submit(request);
  const auto& view = (*made)->collect(static_cast<renderer::SlotIndex>(slot));
  EXPECT_FALSE(view.device_failed);
  EXPECT_EQ(view.stats.nonfinite_px, 0U);
  EXPECT_EQ(view.stats.clamped_px, 0U);
  return {view.temperature_k.begin(), view.temperature_k.end()};
}

/// Scenario of a clear morning with the layers of a road, convection and two days of spin-up.
scene::ScenarioDesc foster_scenario(const std::filesystem::path& gltf) {
  scene::ScenarioDesc s = instant_scenario(gltf);
  s.weather.clear();
  s.materials[0].layers = {{0.15, 0.7, 2120, 920}, {0.3, 1.5, 2000, 950}, {1.55, 1.2, 1900, 1158}};
  s.materials[0].base_k = 286.15;
  s.thermal.model = scene::ThermalModel::foster;
  s.thermal.spin_up_ns = 48 * kHourNs;
  s.thermal.steps = 13;
  s.thermal.spacing = scene::StepSpacing::geometric;
  return s;
}

/// Temperature after the same steps in double, with constant shares of sun and sky.
double expected_k(const scene::ScenarioDesc& s, std::int64_t now_ns, const glm::dvec3& n,
                  double sun_frac = 1.0) {
  const renderer::Environment environment(s);
  auto materials = renderer::foster_materials(s.materials, s.thermal);
  EXPECT_TRUE(materials.has_value());
  const renderer::FosterMaterial material = materials->front();
  renderer::FosterHistory history(s, *materials, material, environment, kReferenceK);
  renderer::StepPlan plan(s.thermal);
  plan.update(now_ns, environment, {});
  history.update(plan, environment);
  const auto surface = physics::foster_surface(material.network, material.emissivity_frac,
                                               material.base_k, kReferenceK);
  physics::FosterState<double> x = history.spun_up(0, n);
  const auto run = [&](std::span<const renderer::IntervalForcing> intervals, double frac) {
    for (renderer::IntervalForcing interval : intervals) {
      interval.begin.sun_w_m2 *= frac;
      interval.end.sun_w_m2 *= frac;
      const double offset_k = physics::foster_offset_k(x, surface);
      physics::foster_advance(
          x, unshadowed_drive(interval.begin, material, n, kReferenceK, offset_k),
          unshadowed_drive(interval.end, material, n, kReferenceK, offset_k),
          physics::foster_ladder(interval.dt_s, material.network), surface, s.thermal.tolerance_k);
    }
  };
  run(history.tail(), 1.0);
  run(history.intervals(), sun_frac);
  return kReferenceK + physics::foster_offset_k(x, surface);
}

physics::Pose looking(const glm::dvec3& from, const glm::dvec3& at) {
  return {from, physics::world_from_body_look_at(from, at)};
}

TEST(RendererFoster, OpenGroundFollowsTheModelInDoubleWithinTenMillikelvin) {
  for (const std::uint32_t modes : {2U, 3U, 4U}) {
    auto scenario = foster_scenario(write_quads("plane", {ground(50.0, 50.0)}));
    scenario.thermal.foster_modes = modes;
    for (const double hours : {0.0, 0.25, 3.5}) {
      const auto now_ns = static_cast<std::int64_t>(hours * static_cast<double>(kHourNs));
      const auto frame = render_k(scenario, looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0}), now_ns);
      const double expected = expected_k(scenario, now_ns, {0.0, 0.0, 1.0});
      double worst_k = 0.0;
      for (const float t : frame) worst_k = std::max(worst_k, std::abs(t - expected));
      RecordProperty("worst_mk", std::to_string(1e3 * worst_k));
      EXPECT_LT(worst_k, 0.01) << modes << " modes at " << hours << " h";
    }
  }
}

TEST(RendererFoster, MoistGroundFollowsTheModelInDoubleAndIsCoolerThanDry) {
  auto scenario = foster_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  const auto pose = looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0});
  // Stomata are closed and dew falls at night; both change by day.
  for (const double hours : {0.0, 3.5, 16.0}) {
    const auto now_ns = static_cast<std::int64_t>(hours * static_cast<double>(kHourNs));
    scenario.materials[0].wetness_frac = 0.0;
    const double dry_k = expected_k(scenario, now_ns, {0.0, 0.0, 1.0});
    for (const double resistance_s_m : {0.0, 70.0}) {
      scenario.materials[0].wetness_frac = 1.0;
      scenario.materials[0].surface_resistance_s_m = resistance_s_m;
      scenario.materials[0].night_resistance_s_m = 3.0 * resistance_s_m;
      const double expected = expected_k(scenario, now_ns, {0.0, 0.0, 1.0});
      double worst_k = 0.0;
      for (const float t : render_k(scenario, pose, now_ns)) {
        worst_k = std::max(worst_k, std::abs(t - expected));
      }
      EXPECT_LT(worst_k, 0.01) << resistance_s_m << " s/m at " << hours << " h";
      if (hours == 3.5) {
        EXPECT_LT(expected, dry_k - 3.0) << resistance_s_m;
      }
    }
  }
}

TEST(RendererFoster, LeavesFollowTheModelInDoubleAndStayNearTheAir) {
  auto scenario = foster_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  scenario.materials[0].layers = {{0.004, 0.15, 120, 3500}, {0.1, 0.1, 6, 2500}};
  const auto pose = looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0});
  for (const double hours : {0.0, 3.5}) {
    const auto now_ns = static_cast<std::int64_t>(hours * static_cast<double>(kHourNs));
    scenario.materials[0].leaf_width_m.reset();
    const double closed_k = expected_k(scenario, now_ns, {0.0, 0.0, 1.0});
    scenario.materials[0].leaf_width_m = 0.05;
    const double expected = expected_k(scenario, now_ns, {0.0, 0.0, 1.0});
    double worst_k = 0.0;
    for (const float t : render_k(scenario, pose, now_ns)) {
      worst_k = std::max(worst_k, std::abs(t - expected));
    }
    EXPECT_LT(worst_k, 0.01) << hours << " h";
    if (hours == 3.5) {
      EXPECT_LT(expected, closed_k - 5.0);
    }
  }
}

TEST(RendererFoster, RainedOnGroundFollowsTheModelInDouble) {
  auto scenario = foster_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  scenario.materials[0].water_store_mm = 0.48;
  const renderer::Environment clear(scenario);
  for (int quarter = -4 * 49; quarter <= 4 * 17; ++quarter) {
    const std::int64_t at_ns = quarter * (kHourNs / 4);
    const physics::Forcing f = clear.forcing_at(at_ns, clear.sun_at(at_ns));
    scene::WeatherSample row;
    row.sim_time_ns = at_ns;
    row.direct_normal_w_m2 = f.direct_normal_w_m2;
    row.diffuse_horizontal_w_m2 = f.diffuse_horizontal_w_m2;
    row.longwave_down_w_m2 = f.longwave_down_w_m2;
    row.air_k = f.air_k;
    row.wind_m_s = f.wind_m_s;
    row.relative_humidity_frac = 0.5;
    row.rain_mm_h = quarter > 8 && quarter <= 12 ? 1.0 : 0.0;  // from 2 h to 3 h
    scenario.weather.push_back(row);
  }
  scene::ScenarioDesc dry = scenario;
  dry.materials[0].water_store_mm.reset();
  const auto pose = looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0});
  for (const double hours : {2.5, 3.25, 8.0}) {
    const auto now_ns = static_cast<std::int64_t>(hours * static_cast<double>(kHourNs));
    const double expected = expected_k(scenario, now_ns, {0.0, 0.0, 1.0});
    double worst_k = 0.0;
    for (const float t : render_k(scenario, pose, now_ns)) {
      worst_k = std::max(worst_k, std::abs(t - expected));
    }
    EXPECT_LT(worst_k, 0.01) << hours << " h";
    const double dry_k = expected_k(dry, now_ns, {0.0, 0.0, 1.0});
    if (hours < 4.0) {
      EXPECT_LT(expected, dry_k - 3.0) << hours;
    } else {
      EXPECT_NEAR(expected, dry_k, 1.5) << "it has dried";
    }
  }
}

TEST(RendererFoster, SaysThatEntitiesHaveTheFilmOfSceneryAndThatThereAreNoRoofs) {
  const auto warnings_of = [](const scene::ScenarioDesc& scenario) {
    auto made = renderer::Renderer::create(scenario, {}, {});
    EXPECT_TRUE(made.has_value()) << (made ? "" : made.error().text);
    std::string all;
    if (!made) return all;
    for (const std::string& warning : (*made)->scene_stats().warnings) all += warning + "\n";
    return all;
  };
  const auto says = [](const std::string& text, const char* part) {
    return text.find(part) != std::string::npos;
  };
  auto scenario = foster_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  scenario.materials[0].water_store_mm = 0.48;
  EXPECT_FALSE(says(warnings_of(scenario), "per-frame"));
  scenario.weather = {weather(300.0, 100.0, 340.0, 290.0)};
  scenario.weather[0].rain_mm_h = 1.0;
  EXPECT_TRUE(says(warnings_of(scenario), "knows no roofs: rain wets all that looks up"));
  park_vehicle(scenario, kHourNs);
  EXPECT_TRUE(says(warnings_of(scenario),
                   "gives 'vehicle' the film of scenery in the wind, without "
                   "its own speed, recovery temperature and 'air_film'"));
  scenario.thermal.method = scene::ThermalMethod::cached;
  const std::string cached = warnings_of(scenario);
  EXPECT_FALSE(says(cached, "film of scenery") || says(cached, "roofs")) << cached;
}

TEST(RendererFoster, TiltedFacesFollowTheModelInDouble) {
  // Look at a plate from its front. It is open, so its obscurance is that of flat ground. No plate
  // turns to or from the sun within an interval, where the clamped cosine of the shader would be
  // more exact.
  for (const glm::dvec3 direction : {glm::dvec3(0.3, -0.8, 0.5), glm::dvec3(-0.9, 0.2, 0.1),
                                     glm::dvec3(0.5, 0.7, 0.4), glm::dvec3(-0.5, 0.6, -0.6)}) {
    const glm::dvec3 n = glm::normalize(direction);
    const glm::dvec3 u = glm::normalize(glm::cross(glm::dvec3(0, 0, 1), n));
    const glm::dvec3 v = glm::cross(n, u);
    const glm::dvec3 c(0.0, 0.0, 60.0);
    auto scenario =
        foster_scenario(write_quads("plate", {{c - 40.0 * u - 40.0 * v, c + 40.0 * u - 40.0 * v,
                                               c + 40.0 * u + 40.0 * v, c - 40.0 * u + 40.0 * v}}));
    scenario.thermal.spacing = scene::StepSpacing::uniform;
    for (const std::int64_t now_ns : {std::int64_t{0}, 3 * kHourNs}) {
      const auto frame = render_k(scenario, looking(c + 5.0 * n + 0.5 * u, c), now_ns);
      const double expected = expected_k(scenario, now_ns, n);
      // Allow for the table of directions, which adds up to 50 mK at the start and millikelvins
      // later.
      const double t = frame[kHeight / 2 * kWidth + kWidth / 2];
      EXPECT_NEAR(t, expected, now_ns == 0 ? 0.05 : 0.01) << n.x << " " << n.y << " " << n.z;
    }
  }
}

TEST(RendererFoster, SteadyWeatherEndsAtTheEquilibriumOverAllLayers) {
  auto scenario = foster_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  scenario.materials[0].layers = {{0.02, 0.5, 2000.0, 900.0}};
  scene::WeatherSample sample = weather(0.0, 120.0, 340.0, 295.0);
  sample.film_w_m2_k = 11.0;
  scenario.weather = {sample};
  const auto frame = render_k(scenario, looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0}), 12 * kHourNs);
  const scene::Material& m = scenario.materials[0];
  const auto root = physics::solve_equilibrium<double>(
      {m.emissivity_frac * physics::kStefanBoltzmannWPerM2K4, 25.0 + 11.0,
       m.solar_absorptance_frac * 120.0 + m.emissivity_frac * 340.0 + 25.0 * m.base_k +
           11.0 * 295.0});
  for (const float t : frame) ASSERT_NEAR(t, root.temperature_k, 1e-3);
}

TEST(RendererFoster, SplittingTheHistoryConvergesAndTheToleranceHolds) {
  auto scenario = foster_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  const auto pose = looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0});
  const auto centre_k = [&](std::uint32_t steps, double tolerance_k) {
    scenario.thermal.steps = steps;
    scenario.thermal.tolerance_k = tolerance_k;
    scenario.thermal.spacing = scene::StepSpacing::uniform;
    return render_k(scenario, pose, 3 * kHourNs + kHourNs / 2)[kHeight / 2 * kWidth + kWidth / 2];
  };
  const float fine = centre_k(256, 1e-3);
  EXPECT_NEAR(centre_k(27, 0.1), fine, 0.1F);
  EXPECT_NEAR(centre_k(90, 0.01), fine, 0.02F);
}

TEST(RendererFoster, ShadeCoolsTheGroundAndPrescribedPartsKeepTheirTemperature) {
  auto quads = box({-1.0, -1.0, 0.0}, {1.0, 1.0, 2.0});
  quads.push_back(ground(30.0, 30.0));
  auto scenario = foster_scenario(write_quads("box", quads));
  scenario.thermal.steps = 27;
  const auto pose = looking({0.0, 0.1, 25.0}, {0.0, 0.0, 0.0});
  const auto frame = render_k(scenario, pose, 3 * kHourNs);
  float lowest = 1e9F;
  float highest = 0.0F;
  for (const float t : frame) {
    lowest = std::min(lowest, t);
    highest = std::max(highest, t);
  }
  const double open_k = expected_k(scenario, 3 * kHourNs, {0.0, 0.0, 1.0});
  EXPECT_NEAR(highest, open_k, 0.3);
  // Ground that the sun has not reached since the start is not cooler than the model without direct
  // sun, which sees the whole sky.
  const double shaded_k = expected_k(scenario, 3 * kHourNs, {0.0, 0.0, 1.0}, 0.0);
  EXPECT_LT(lowest, open_k - 4.0);
  EXPECT_GT(lowest, shaded_k - 1.0);
  EXPECT_LT(shaded_k, open_k - 6.0);

  scenario.materials[0].prescribed_k = 333.0;
  for (const float t : render_k(scenario, pose, 3 * kHourNs)) ASSERT_NEAR(t, 333.0F, 1e-3F);
}

TEST(RendererFoster, RefusesSurroundingsThatDoNotExist) {
  auto scenario = foster_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  scenario.thermal.surroundings_material = "gras";
  auto made = renderer::Renderer::create(scenario, {}, {});
  ASSERT_FALSE(made);
  EXPECT_NE(made.error().text.find("'gras'"), std::string::npos);
}

}  // namespace
}  // namespace emit::test
