// SPDX-License-Identifier: Apache-2.0
// A body that the host has turned or lifted shows what it would show if it had started there: sky
// above the horizon of its attitude of now, surroundings below it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <string>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/physics/planck.hpp"
#include "support/cached_session.hpp"

namespace emit::test {
namespace {

constexpr double kHighM = 50.0;
constexpr std::int64_t kStartNs = 2 * kHourNs;
constexpr std::int64_t kTurnedNs = kStartNs + 20 * kSecondNs;
constexpr std::int64_t kSettledNs = kStartNs + 2400 * kSecondNs;
constexpr std::int64_t kTurnStepNs = 5 * kSecondNs;

/// Pose of the slab with its centre at a height.
physics::Pose slab_pose(double up_m, double heading, double pitch, double roll) {
  return {{0.0, 0.0, up_m},
          physics::world_from_body_heading_pitch_roll(
              heading * physics::kDegree, pitch * physics::kDegree, roll * physics::kDegree)};
}

/// Scenario of a small ground and a slab, entity 7, that hangs over it. All of it has a metal skin
/// on foam, which settles within minutes and reflects nine tenths of what comes in.
scene::ScenarioDesc slab_world(std::vector<Quad> slab, const physics::Pose& pose) {
  scene::ScenarioDesc s = cached_scenario(write_quads("ground", {ground(6.0, 6.0)}));
  s.materials[0].layers = {{0.001, 200.0, 2700, 900}, {0.05, 0.05, 50, 1000}};
  s.materials[0].modes.clear();
  s.materials[0].emissivity_frac = 0.1;
  s.materials[0].solar_absorptance_frac = 0.3;
  scene::ObjectDesc body = s.objects.front();
  body.name = "slab";
  body.gltf = write_quads("slab", slab);
  body.entity_id = 7;
  body.instances = {pose};
  s.objects.push_back(body);
  return s;
}

/// Closed box of 2 m x 2 m x 0.2 m around the origin.
std::vector<Quad> slab() {
  auto quads = box({-1.0, -1.0, -0.1}, {1.0, 1.0, 0.1});
  const Quad under = ground(1.0, 1.0, -0.1);
  quads.push_back({under.d, under.c, under.b, under.a});
  return quads;
}

/// Apparent temperature by pixel of the slab in K; 0 where the image shows something else.
std::vector<double> apparent_k(renderer::Renderer& renderer, const scene::ScenarioDesc& scenario,
                               std::int64_t now_ns, const physics::Pose& eye) {
  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = now_ns;
  request.sensor_pose = eye;
  const auto slot = static_cast<renderer::SlotIndex>(renderer.submit(request));
  const auto& view = renderer.collect(slot);
  EXPECT_FALSE(view.device_failed);
  std::vector<double> out;
  for (std::size_t i = 0; i < view.object_id.size(); ++i) {
    double k = 0.0;
    if (view.object_id[i] == 2.0F) {
      const auto found = physics::brightness_temperature(
          physics::Band{scenario.bands.front().lo_um, scenario.bands.front().hi_um, {}},
          physics::Radiance(static_cast<double>(view.radiance_w_m2_sr.front()[i])));
      EXPECT_TRUE(found);
      if (found) k = found->value();
    }
    out.push_back(k);
  }
  renderer.release(slot);
  return out;
}

/// Greatest difference over the slab between one that the host brought from `before` to `after`,
/// and one that started at `after`.
struct TurnError {
  double most_k = 0.0;
  std::size_t pixels = 0;
};
TurnError turn_error(const std::vector<Quad>& body, const physics::Pose& before,
                     const physics::Pose& after) {
  const glm::dvec3 from = after.position_world_m + glm::dvec3(3.0, -4.0, 1.5);
  const physics::Pose eye = looking(from, after.position_world_m);
  renderer::OutputOptions output;
  output.object = true;
  std::vector<double> turned;
  {
    const scene::ScenarioDesc s = slab_world(body, before);
    auto made = renderer::Renderer::create(s, {}, output);
    if (!made) {
      ADD_FAILURE() << made.error().text;
      return {};
    }
    for (std::int64_t now_ns = kStartNs; now_ns <= kSettledNs; now_ns += kTurnStepNs) {
      const renderer::EntityUpdate update{7, now_ns < kTurnedNs ? before : after, true, false};
      EXPECT_EQ((*made)->apply_entities(now_ns, {&update, 1}), 1U);
      turned = apparent_k(**made, s, now_ns, eye);
    }
  }
  const scene::ScenarioDesc s = slab_world(body, after);
  auto made = renderer::Renderer::create(s, {}, output);
  if (!made) {
    ADD_FAILURE() << made.error().text;
    return {};
  }
  const std::vector<double> fresh = apparent_k(**made, s, kSettledNs, eye);
  TurnError out;
  for (std::size_t i = 0; i < fresh.size(); ++i) {
    if (fresh[i] == 0.0 || turned[i] == 0.0) continue;
    out.most_k = std::max(out.most_k, std::abs(fresh[i] - turned[i]));
    ++out.pixels;
  }
  testing::Test::RecordProperty("difference_k", std::to_string(out.most_k));
  return out;
}

struct Turn {
  const char* name;
  physics::Pose before;
  physics::Pose after;
  double bar_k = 0.5;
};
void PrintTo(const Turn& turn, std::ostream* out) {
  *out << turn.name;
}

class RendererCachedAttitude : public testing::TestWithParam<Turn> {};

TEST_P(RendererCachedAttitude, ABodyThatTurnedLooksLikeOneThatStartedSo) {
  const TurnError found = turn_error(slab(), GetParam().before, GetParam().after);
  EXPECT_GT(found.pixels, 200U);
  // The slab reflects nine tenths. One that started so shows the ground with its own temperature,
  // and one that moved shows surroundings in its place.
  EXPECT_LT(found.most_k, GetParam().bar_k);
}

const physics::Pose kLevel = slab_pose(kHighM, 0.0, 0.0, 0.0);
INSTANTIATE_TEST_SUITE_P(
    , RendererCachedAttitude,
    testing::Values(Turn{"rolled", kLevel, slab_pose(kHighM, 0.0, 0.0, 90.0)},
                    Turn{"pitched", kLevel, slab_pose(kHighM, 0.0, 35.0, 0.0), 0.7},
                    Turn{"yawed", kLevel, slab_pose(kHighM, 60.0, 0.0, 0.0)},
                    Turn{"inverted", kLevel, slab_pose(kHighM, 0.0, 0.0, 180.0)},
                    Turn{"climbed", slab_pose(0.3, 0.0, 0.0, 0.0), kLevel}),
    [](const auto& turn) { return turn.param.name; });

}  // namespace
}  // namespace emit::test
