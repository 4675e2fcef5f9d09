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
const StartPlace kStartPlaces[] = {{"open", {-12.5, -12.5, 0.0}},
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

/// Temperatures of the places.
std::vector<double> rendered_k(const scene::ScenarioDesc& s, std::int64_t now_ns) {
  Session session(s);
  (void)session.frame_k(now_ns, looking({0.0, -16.0, 9.0}, {0.0, 0.0, 0.0}));
  std::vector<double> out;
  for (const StartPlace& place : kStartPlaces) {
    const auto sample =
        session.renderer().nearest_sample({place.position_m, glm::dvec3(0.0, 0.0, 1.0)});
    EXPECT_TRUE(sample.has_value()) << place.name;
    out.push_back(sample ? session.renderer().sample_reading(*sample).temperature_k : 0.0);
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
    const std::vector<double> is_k = rendered_k(s, now_ns);
    const std::vector<double> weeks_k = rendered_k(weeks, now_ns);
    for (std::size_t i = 0; i < std::size(kStartPlaces); ++i) {
      const double off_k = is_k[i] - weeks_k[i];
      std::printf("%2lld h, %-21s %.2f K, after weeks %.2f K, off %+.2f K\n",
                  static_cast<long long>(now_ns / kHourNs), kStartPlaces[i].name, is_k[i],
                  weeks_k[i], off_k);
      EXPECT_LT(std::abs(off_k), 0.3) << kStartPlaces[i].name << ", " << now_ns / kHourNs << " h";
    }
  }
}

}  // namespace
}  // namespace emit::test
