// SPDX-License-Identifier: Apache-2.0
// Rain wets what lies open to the sky, tilted faces by their cosine, and nothing under a roof.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "emit/reference/solve.hpp"
#include "emit/scene/mesh.hpp"
#include "support/cached_session.hpp"
#include "support/renderer_scene.hpp"

namespace emit::test {
namespace {

const glm::dvec3 kTiltedNormal(std::sqrt(0.75), 0.0, 0.5);  // 60 degrees
const glm::dvec3 kTiltedPlace(9.0, 0.0, 3.0);

/// Fine ground, a roof 3 m above its middle, and a plate tilted by 60 degrees in the open.
std::filesystem::path roof_and_plate() {
  std::vector<Quad> quads = fine_ground(14.0, 1.0);
  for (const Quad& quad : box({-3.0, -3.0, 3.0}, {3.0, 3.0, 3.3})) quads.push_back(quad);
  const glm::dvec3 u(0.0, 1.0, 0.0);
  const glm::dvec3 v = glm::cross(kTiltedNormal, u);
  quads.push_back(
      {kTiltedPlace - u - v, kTiltedPlace + u - v, kTiltedPlace + u + v, kTiltedPlace - u + v});
  return write_quads("roof", quads);
}

/// Overcast day with a shower from 1 h to 2 h. Nothing exchanges radiation, so that what rain does
/// to one place does not show at another.
scene::ScenarioDesc rainy_day(double rain_mm_h) {
  scene::ScenarioDesc s = cached_scenario(roof_and_plate());
  s.materials[0].water_store_mm = 1.9;
  s.thermal.exchange = false;
  for (int quarter = -4 * 60; quarter <= 4 * 12; ++quarter) {
    scene::WeatherSample row;
    row.sim_time_ns = quarter * (kHourNs / 4);
    row.diffuse_horizontal_w_m2 = 150.0;
    row.longwave_down_w_m2 = 370.0;
    row.air_k = 292.0;
    row.environment_k = 292.0;
    row.wind_m_s = 3.0;
    row.relative_humidity_frac = 0.45;
    row.rain_mm_h = quarter > 4 && quarter <= 8 ? rain_mm_h : 0.0;
    s.weather.push_back(row);
  }
  return s;
}

struct RainPlace {
  const char* name;
  glm::dvec3 position_m;
  glm::dvec3 normal;
  double wetter_k;  ///< least fall of the temperature by the rain
  double drier_k;   ///< greatest
};
const RainPlace kRainPlaces[] = {
    {"open", {-9.5, -9.5, 0.0}, {0.0, 0.0, 1.0}, 3.0, 12.0},
    {"under the roof", {0.5, 0.5, 0.0}, {0.0, 0.0, 1.0}, -0.02, 0.02},
    {"on the roof", {0.0, 0.0, 3.3}, {0.0, 0.0, 1.0}, 3.0, 12.0},
    {"wall", {-3.0, 0.0, 3.15}, {-1.0, 0.0, 0.0}, -0.02, 0.02},
    {"tilted", kTiltedPlace, kTiltedNormal, 1.0, 12.0},
};

std::vector<double> rendered_k(const scene::ScenarioDesc& s, std::int64_t now_ns) {
  Session session(s);
  (void)session.frame_k(now_ns, looking({0.0, -12.0, 6.0}, {0.0, 0.0, 0.0}));
  std::vector<double> out;
  for (const RainPlace& place : kRainPlaces) {
    const auto sample = session.renderer().nearest_sample({place.position_m, place.normal});
    EXPECT_TRUE(sample.has_value()) << place.name;
    out.push_back(sample ? session.renderer().sample_reading(*sample).temperature_k : 0.0);
  }
  return out;
}

std::vector<double> solved_k(const scene::ScenarioDesc& s, std::int64_t now_ns) {
  const auto geometry = scene::load_scene(s);
  EXPECT_TRUE(geometry.has_value());
  reference::SolveOptions options;
  options.dimension = reference::SolveDimension::one;
  auto solver = reference::SceneSolver::create(s, *geometry, options, now_ns);
  EXPECT_TRUE(solver.has_value()) << (solver ? "" : solver.error().text);
  if (!solver) return std::vector<double>(std::size(kRainPlaces));
  EXPECT_TRUE(solver->advance_to(now_ns).has_value());
  std::vector<reference::SolveProbe> probes;
  for (const RainPlace& place : kRainPlaces) probes.push_back({place.position_m, place.normal, ""});
  const auto points = solver->probe(probes, now_ns);
  EXPECT_TRUE(points.has_value());
  std::vector<double> out;
  for (const auto& point : *points) out.push_back(point.temperature_k);
  return out;
}

TEST(RendererRain, WetsWhatLiesOpenAsTheReferenceHasIt) {
  const scene::ScenarioDesc wet = rainy_day(0.8);
  const scene::ScenarioDesc dry = rainy_day(0.0);
  for (const std::int64_t now_ns : {2 * kHourNs, 3 * kHourNs}) {
    const std::vector<double> is_k = rendered_k(wet, now_ns);
    const std::vector<double> dry_k = rendered_k(dry, now_ns);
    const std::vector<double> truth_k = solved_k(wet, now_ns);
    const std::vector<double> dry_truth_k = solved_k(dry, now_ns);
    for (std::size_t i = 0; i < std::size(kRainPlaces); ++i) {
      const RainPlace& place = kRainPlaces[i];
      // Compare falls: the days before the shower have left more than it does.
      const double fall_k = dry_k[i] - is_k[i];
      const double true_fall_k = dry_truth_k[i] - truth_k[i];
      std::printf("%-15s %.2f K, fall by the rain %.2f K, reference %.2f K\n", place.name, is_k[i],
                  fall_k, true_fall_k);
      EXPECT_GE(fall_k, place.wetter_k) << place.name;
      EXPECT_LE(fall_k, place.drier_k) << place.name;
      EXPECT_NEAR(fall_k, true_fall_k, 0.15) << place.name;
    }
    // The tilted plate has had half of the rain.
    EXPECT_LT(dry_k[4] - is_k[4], dry_k[0] - is_k[0]);
  }
}

TEST(RendererRain, AnEntityThatLeavesItsPlaceUncoversItAndFramesSaySo) {
  scene::ScenarioDesc s = rainy_day(2.0);
  park_vehicle(s, 3 * kHourNs);
  const auto limits_at = [](Session& session, std::int64_t now_ns) {
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = now_ns;
    request.sensor_pose = looking({0.0, -12.0, 6.0}, {0.0, 0.0, 0.0});
    const auto slot = static_cast<renderer::SlotIndex>(session.renderer().submit(request));
    const renderer::HeatLimits limits = session.renderer().collect(slot).stats.heat_limits;
    session.renderer().release(slot);
    return limits;
  };
  Session session(s);
  for (int seconds = -20; seconds <= 20; seconds += 5) {
    const renderer::HeatLimits limits = limits_at(session, 3 * kHourNs + seconds * kSecondNs);
    if (seconds == 0) continue;  // it leaves
    EXPECT_EQ(renderer::has(limits, renderer::HeatLimit::rain_shelter), seconds > 0) << seconds;
  }
}

}  // namespace
}  // namespace emit::test
