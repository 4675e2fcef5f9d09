// SPDX-License-Identifier: Apache-2.0
// Geometry that is far away changes nothing that is near.
#include <gtest/gtest.h>

#include "support/cached_session.hpp"
#include "support/renderer_scene.hpp"

namespace emit::test {
namespace {

struct Seen {
  std::vector<float> frame_k;
  std::uint64_t samples = 0;
};

Seen seen(const scene::ScenarioDesc& scenario) {
  Session run(scenario);
  Seen out;
  out.frame_k = run.frame_k(3 * kHourNs, looking({3.0, -9.0, 6.0}, {0.0, 0.0, 0.0}));
  out.samples = run.renderer().scene_stats().samples;
  return out;
}

void expect_alike(const Seen& clean, const Seen& other) {
  EXPECT_LT(difference(clean.frame_k, other.frame_k).max_k, 1e-3);
  EXPECT_NEAR(static_cast<double>(other.samples), static_cast<double>(clean.samples),
              0.05 * static_cast<double>(clean.samples));
}

TEST(RendererStray, AnEntityThatIsOffAndFarAwayChangesNothing) {
  auto scenario = cached_scenario(box_on_ground());
  scenario.thermal.lateral = true;
  const Seen clean = seen(scenario);
  for (const glm::dvec3& place_m : {glm::dvec3(0.0, 0.0, -6e6), glm::dvec3(4e5, 0.0, 0.0)}) {
    auto with = scenario;
    scene::ObjectDesc entity = with.objects.front();
    entity.name = "aircraft";
    entity.gltf = write_quads("aircraft", box({-1.5, -1.0, 0.3}, {1.5, 1.0, 2.0}));
    entity.entity_id = 7;
    entity.on = false;
    entity.instances.front().position_world_m = place_m;
    with.objects.push_back(entity);
    // The samples of the entity itself count as well.
    Seen other = seen(with);
    const double own = static_cast<double>(other.samples) - static_cast<double>(clean.samples);
    EXPECT_LT(own, 200.0);
    other.samples = clean.samples;
    expect_alike(clean, other);
  }
}

TEST(RendererStray, AFewTrianglesFarAwayChangeNothing) {
  // The number of triangles keeps the stray ones a small share.
  auto quads = box({-1.0, -1.0, 0.0}, {1.0, 1.0, 2.0});
  for (int i = -8; i < 8; ++i) {
    for (int j = -8; j < 8; ++j) {
      const glm::dvec3 low(1.5 * i, 1.5 * j, 0.0);
      quads.push_back({low, low + glm::dvec3(1.5, 0.0, 0.0), low + glm::dvec3(1.5, 1.5, 0.0),
                       low + glm::dvec3(0.0, 1.5, 0.0)});
    }
  }
  const Seen clean = seen(cached_scenario(write_quads("clean", quads)));
  for (const glm::dvec3& place_m :
       {glm::dvec3(0.0, 0.0, -6e6), glm::dvec3(1e6, 0.0, 0.0), glm::dvec3(-2e5, 3e5, 100.0)}) {
    auto with = quads;
    with.push_back({place_m, place_m + glm::dvec3(1.0, 0.0, 0.0),
                    place_m + glm::dvec3(1.0, 1.0, 0.0), place_m + glm::dvec3(0.0, 1.0, 0.0)});
    expect_alike(clean, seen(cached_scenario(write_quads("stray", with))));
  }
}

}  // namespace
}  // namespace emit::test
