// SPDX-License-Identifier: Apache-2.0
// Thick ground under a roof begins in the balance of its own shade. A hundred days of shaded
// history from a stated temperature judge that: they share the steps of the history, but neither
// the start nor the assumption that the days before were like the first one.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <vector>

#include "support/cached_session.hpp"
#include "support/renderer_scene.hpp"

namespace emit::test {
namespace {

struct StartPlace {
  const char* name;
  glm::dvec3 position_m;
};
using StartPlaces = std::vector<StartPlace>;
const StartPlaces kRoofPlaces = {{"open", {-12.5, -12.5, 0.0}},
                                 {"under the middle", {0.5, 0.5, 0.0}},
                                 {"under the north edge", {0.5, 3.5, 0.0}},
                                 {"under the south edge", {0.5, -3.5, 0.0}},
                                 {"north of it", {0.5, 7.5, 0.0}}};

/// A roof of 8 m by 8 m, 2.5 m above two metres of ground, which remember for weeks.
scene::ScenarioDesc roof_on_thick_ground() {
  std::vector<Quad> quads = fine_ground(14.0, 1.0);
  for (const Quad& quad : box({-4.0, -4.0, 2.5}, {4.0, 4.0, 2.7})) quads.push_back(quad);
  const Quad under = ground(4.0, 4.0, 2.5);
  quads.push_back({under.d, under.c, under.b, under.a});
  scene::ScenarioDesc s = cached_scenario(write_quads("thick_roof", quads));
  s.materials[0].foster_modes.clear();
  s.thermal.spin_up_ns = 0;
  s.thermal.history_start_ns = -36 * kHourNs;
  s.thermal.steps = 48;
  return s;
}

/// A wall of 4 m that runs from south to north, on two metres of ground.
scene::ScenarioDesc wall_on_thick_ground() {
  std::vector<Quad> quads = fine_ground(14.0, 1.0);
  for (const Quad& quad : box({-0.2, -8.0, 0.0}, {0.2, 8.0, 4.0})) quads.push_back(quad);
  scene::ScenarioDesc s = cached_scenario(write_quads("wall", quads));
  s.materials[0].foster_modes.clear();
  return s;
}
const StartPlaces kWallPlaces = {{"open", {-12.5, -12.5, 0.0}},
                                 {"shaded in the afternoon", {1.5, 0.5, 0.0}}};

/// Temperatures of the places.
std::vector<double> rendered_k(const scene::ScenarioDesc& s, std::int64_t now_ns,
                               const StartPlaces& places) {
  Session session(s);
  (void)session.frame_k(now_ns, looking({0.0, -16.0, 9.0}, {0.0, 0.0, 0.0}));
  std::vector<double> out;
  for (const StartPlace& place : places) {
    const auto sample =
        session.renderer().nearest_sample({place.position_m, glm::dvec3(0.0, 0.0, 1.0)});
    EXPECT_TRUE(sample.has_value()) << place.name;
    out.push_back(sample ? session.renderer().sample_reading(*sample).temperature_k : 0.0);
  }
  return out;
}

/// Returns by how much the temperatures are off those that weeks of shaded history leave.
std::vector<double> off_k(const scene::ScenarioDesc& s, const scene::ScenarioDesc& weeks,
                          std::int64_t now_ns, const StartPlaces& places) {
  const std::vector<double> is_k = rendered_k(s, now_ns, places);
  const std::vector<double> weeks_k = rendered_k(weeks, now_ns, places);
  std::vector<double> out;
  for (std::size_t i = 0; i < places.size(); ++i) {
    out.push_back(is_k[i] - weeks_k[i]);
    std::printf("%2lld h, %-23s %.2f K, after weeks %.2f K, off %+.2f K\n",
                static_cast<long long>(now_ns / kHourNs), places[i].name, is_k[i], weeks_k[i],
                out.back());
  }
  return out;
}

TEST(RendererStart, ThickGroundHasKnownItsShadeForWeeks) {
  scene::ScenarioDesc s = roof_on_thick_ground();
  scene::ScenarioDesc weeks = s;
  weeks.thermal.history_start_ns = -2400 * kHourNs;
  weeks.thermal.steps = 400;
  s.thermal.initial_stated = false;
  for (const std::int64_t now_ns : {4 * kHourNs, 14 * kHourNs}) {
    const std::vector<double> off = off_k(s, weeks, now_ns, kRoofPlaces);
    for (std::size_t i = 0; i < off.size(); ++i) {
      EXPECT_LT(std::abs(off[i]), 0.3) << kRoofPlaces[i].name << ", " << now_ns / kHourNs << " h";
    }
  }
}

TEST(RendererStart, AnAfternoonInTheShadeIsNotAWholeDayInIt) {
  // The stated history has four hours of the afternoon, and nothing is known of the rest of the
  // day.
  scene::ScenarioDesc s = wall_on_thick_ground();
  scene::ScenarioDesc weeks = s;
  weeks.thermal.spin_up_ns = 0;
  weeks.thermal.history_start_ns = -2400 * kHourNs;
  weeks.thermal.steps = 400;
  s.thermal.initial_stated = false;
  s.thermal.spin_up_ns = 48 * kHourNs;
  s.thermal.history_start_ns = 5 * kHourNs;
  s.thermal.steps = 48;
  const std::vector<double> off = off_k(s, weeks, 9 * kHourNs, kWallPlaces);
  for (std::size_t i = 0; i < off.size(); ++i) {
    EXPECT_LT(std::abs(off[i]), 0.6) << kWallPlaces[i].name;
  }
}

}  // namespace
}  // namespace emit::test
