// SPDX-License-Identifier: Apache-2.0
// Geometry that is far away changes nothing that is near.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

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

/// Rectangle of ground between two corners.
Quad level(const glm::dvec2& low, const glm::dvec2& high) {
  return {{low.x, low.y, 0.0}, {high.x, low.y, 0.0}, {high.x, high.y, 0.0}, {low.x, high.y, 0.0}};
}

/// Four rectangles of ground around the square from -inner_m to inner_m.
void add_frame(std::vector<Quad>& quads, double inner_m, double outer_m) {
  quads.push_back(level({-outer_m, -outer_m}, {outer_m, -inner_m}));
  quads.push_back(level({-outer_m, inner_m}, {outer_m, outer_m}));
  quads.push_back(level({-outer_m, -inner_m}, {-inner_m, inner_m}));
  quads.push_back(level({inner_m, -inner_m}, {outer_m, inner_m}));
}

TEST(RendererStray, ACountryAroundTheSceneLeavesItsShadowsAlone) {
  auto quads = box({-1.0, -1.0, 0.0}, {1.0, 1.0, 2.0});
  quads.push_back(ground(20.0, 20.0));
  add_frame(quads, 20.0, 400.0);
  const Seen near = seen(cached_scenario(write_quads("near", quads)));
  // Add tiles of 25 km, so many that they are the bulk of the scene.
  constexpr double kTileM = 25e3;
  add_frame(quads, 400.0, kTileM);
  for (int i = -6; i < 6; ++i) {
    for (int j = -6; j < 6; ++j) {
      if (std::abs(i + 0.5) < 1.0 && std::abs(j + 0.5) < 1.0) continue;
      const glm::dvec2 low(kTileM * i, kTileM * j);
      quads.push_back(level(low, low + kTileM));
    }
  }
  const Seen wide = seen(cached_scenario(write_quads("wide", quads)));
  const Difference off = difference(near.frame_k, wide.frame_k);
  RecordProperty("max_mk", static_cast<int>(1e3 * off.max_k));
  EXPECT_LT(off.p99_k, 0.05);
  // One pixel lies at the edge of the moving shadow; without gusts, which let the ground answer
  // faster, it was below 0.5 K.
  EXPECT_LT(off.max_k, 0.8);
}

TEST(RendererStray, AnEntityShadesItselfWhereverItStands) {
  // The entity is a deck with a wall on it. Beyond 20 km it sees its own hull alone. All places are
  // at one height, because the air is colder higher up.
  auto deck = box({-0.3, -2.0, 0.0}, {0.3, 2.0, 1.5});
  deck.push_back(ground(3.0, 3.0));
  const auto seen_at = [&](const glm::dvec3& place_m) {
    auto s = cached_scenario(write_quads("field", {ground(50.0, 50.0)}));
    scene::ObjectDesc entity = s.objects.front();
    entity.name = "deck";
    entity.gltf = write_quads("deck", deck);
    entity.entity_id = 7;
    entity.instances.front().position_world_m = place_m;
    s.objects.push_back(entity);
    Session run(s);
    return run.frame_k(3 * kHourNs, looking(place_m + glm::dvec3(3.0, -9.0, 6.0), place_m));
  };
  const auto near_k = seen_at({30e3, 0.0, 1e3});
  const auto [low, high] = std::ranges::minmax_element(near_k, [](float a, float b) {
    return (std::isnan(a) ? 300.0F : a) < (std::isnan(b) ? 300.0F : b);
  });
  ASSERT_GT(*high - *low, 5.0F);  // the shadow of the wall
  for (const glm::dvec3& place_m :
       {glm::dvec3(40e3, 0.0, 1e3), glm::dvec3(4e5, 0.0, 1e3), glm::dvec3(-1e5, 8e5, 1e3)}) {
    const Difference off = difference(near_k, seen_at(place_m));
    RecordProperty("max_mk", static_cast<int>(1e3 * off.max_k));
    EXPECT_LT(off.max_k, 1e-3) << place_m.x;
  }
}

}  // namespace
}  // namespace emit::test
