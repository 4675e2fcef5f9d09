// SPDX-License-Identifier: Apache-2.0
// Thick ground under a roof begins in the balance of its own shade. The reference judges that with
// fifty days of shaded history from a stated temperature: it shares neither the start nor the
// assumption that the days before the history were like its first one.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <vector>

#include "emit/reference/solve.hpp"
#include "emit/scene/mesh.hpp"
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

TEST(RendererStart, ThickGroundHasKnownItsShadeForWeeks) {
  scene::ScenarioDesc s = roof_on_thick_ground();
  scene::ScenarioDesc weeks = s;
  weeks.thermal.spin_up_ns = kSecondNs;
  s.thermal.initial_stated = false;
  const std::int64_t times_ns[] = {4 * kHourNs, 14 * kHourNs};
  const auto geometry = scene::load_scene(weeks);
  ASSERT_TRUE(geometry.has_value());
  reference::SolveOptions options;
  options.dimension = reference::SolveDimension::one;
  options.rays = 128;
  options.spin_up_s = 50.0 * 86'400.0;
  auto solver = reference::SceneSolver::create(weeks, *geometry, options, times_ns[1]);
  ASSERT_TRUE(solver.has_value()) << solver.error().text;
  std::vector<reference::SolveProbe> probes;
  for (const StartPlace& place : kStartPlaces) {
    probes.push_back({place.position_m, glm::dvec3(0.0, 0.0, 1.0), ""});
  }
  for (const std::int64_t now_ns : times_ns) {
    Session session(s);
    (void)session.frame_k(now_ns, looking({0.0, -16.0, 9.0}, {0.0, 0.0, 0.0}));
    const auto truth = solver->probe(probes, now_ns);
    ASSERT_TRUE(truth.has_value()) << truth.error().text;
    for (std::size_t i = 0; i < std::size(kStartPlaces); ++i) {
      const auto sample = session.renderer().nearest_sample(
          {kStartPlaces[i].position_m, glm::dvec3(0.0, 0.0, 1.0)});
      ASSERT_TRUE(sample.has_value()) << kStartPlaces[i].name;
      const double is_k = session.renderer().sample_reading(*sample).temperature_k;
      const double true_k = (*truth)[i].temperature_k;
      std::printf("%2lld h, %-21s %.2f K, reference %.2f K, off %+.2f K\n",
                  static_cast<long long>(now_ns / kHourNs), kStartPlaces[i].name, is_k, true_k,
                  is_k - true_k);
      EXPECT_NEAR(is_k, true_k, 0.4) << kStartPlaces[i].name << ", " << now_ns / kHourNs << " h";
    }
  }
}

}  // namespace
}  // namespace emit::test
