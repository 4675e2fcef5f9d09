// SPDX-License-Identifier: Apache-2.0
// Shade of entities that the host drives lies where they are, not where they were when the rays of
// an interval were sent.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "emit/physics/constants.hpp"
#include "support/cached_session.hpp"

namespace emit::test {
namespace {

/// Sends the pose of entity 7.
void tell(Session& session, std::int64_t sim_time_ns, const physics::Pose& pose) {
  const renderer::EntityUpdate update{7, pose, true, false};
  EXPECT_EQ(session.renderer().apply_entities(sim_time_ns, {&update, 1}), 1U);
}

/// Scenario in which a plate flies over squares of ground at constant speed, along the middle row
/// of the image.
struct Flyover {
  static constexpr double kHalfLengthM = 5.0;
  static constexpr double kHeightM = 10.0;
  static constexpr double kSpeedMs = 2.5;
  static constexpr double kOverOriginS = 7270.0;  ///< time at which its shade is over the origin
  static constexpr double kFromS = 7259.0;
  static constexpr double kToS = 7281.0;
  static constexpr double kEyeM = 28.0;

  scene::ScenarioDesc scenario = cached_scenario(write_quads("ground", fine_ground(16.0, 0.25)));
  physics::Pose eye = looking({0.0, -0.001, kEyeM}, {0.0, 0.0, 0.0});

  Flyover() {
    scene::ObjectDesc plate = scenario.objects.front();
    plate.name = "plate";
    plate.gltf = write_quads("plate", {ground(kHalfLengthM, 2.0)});
    plate.entity_id = 7;
    plate.instances = {at(kFromS)};
    scenario.objects.push_back(plate);
  }
  [[nodiscard]] physics::Pose at(double seconds) const {
    const glm::dvec3 sun = to_sun(scenario, kOverOriginS);
    physics::Pose pose = scenario.objects.front().instances.front();
    pose.position_world_m = kHeightM / sun.z * sun;
    const double moving_s = std::clamp(seconds, kFromS, kToS) - kOverOriginS;
    pose.position_world_m.x += kSpeedMs * moving_s;
    return pose;
  }
  /// Distance of a column of the track from the origin, m.
  [[nodiscard]] double track_m(std::uint32_t column) const {
    const double px_m = 2.0 * kEyeM * std::tan(0.5 * scenario.sensor.fov_h_rad) / kWidth;
    return (column + 0.5 - 0.5 * kWidth) * px_m;
  }
  /// Interval in which the plate shades a column, if it moves over it.
  [[nodiscard]] std::optional<Shade> passage(std::uint32_t column) const {
    const double middle_s = kOverOriginS + track_m(column) / kSpeedMs;
    constexpr double kHalfS = kHalfLengthM / kSpeedMs;
    // Leave out the columns where it waits and where it stops, because it hides some of the sky
    // there.
    if (std::abs(track_m(column)) > 8.0) return std::nullopt;
    return Shade{middle_s - kHalfS, middle_s + kHalfS};
  }
  [[nodiscard]] static const float* track(const std::vector<float>& frame) {
    return &frame[std::size_t{kHeight} / 2 * kWidth];
  }
};

TEST(RendererCachedLive, ShadeGoesWithABodyThatTheHostMoves) {
  const Flyover world;
  Session run(world.scenario);
  // The ground of a column goes on from comparison to comparison, as soon as the shade is there.
  std::map<std::uint32_t, OpenGround> shaded;
  const auto without_sun = [](renderer::SurfaceForcing& forcing) {
    forcing.sun_w_m2 = glm::dvec3(0.0);
  };
  int compared = 0;
  for (std::int64_t quarter = 4 * 7245; quarter <= 4 * 7325; ++quarter) {
    const double now_s = 0.25 * static_cast<double>(quarter);
    const std::int64_t now_ns = std::llround(now_s * 1e9);
    tell(run, now_ns, world.at(now_s));
    const auto frame = run.frame_k(now_ns, world.eye);
    if (quarter % 17 != 0) continue;
    const double open_k = open_ground_k(world.scenario, now_ns);
    for (std::uint32_t column = 4; column < kWidth; column += 11) {
      const auto shade = world.passage(column);
      if (!shade) continue;
      const auto [in_s, out_s] = *shade;
      double expected_k = open_k;
      if (now_s > in_s) {
        const auto made =
            shaded.try_emplace(column, world.scenario, std::span<const scene::WeatherSample>(),
                               std::llround(in_s * 1e9));
        OpenGround& ground = made.first->second;
        const std::int64_t lit_ns = std::llround(std::min(now_s, out_s) * 1e9);
        if (ground.at_ns() < lit_ns) ground.go_on(lit_ns, without_sun);
        if (ground.at_ns() < now_ns) ground.go_on(now_ns);
        expected_k = ground.temperature_k();
      }
      // Allow more near the edges of the shade, because shade is the mean over a step.
      const double nearest_s = std::min(std::abs(now_s - in_s), std::abs(now_s - out_s));
      EXPECT_NEAR(Flyover::track(frame)[column], expected_k, nearest_s < 1.5 ? 0.08 : 0.06)
          << now_s << " s, column " << column << ", shade " << in_s << " to " << out_s;
      ++compared;
    }
  }
  EXPECT_GT(compared, 60);
}

TEST(RendererCachedLive, WhatTheScriptPlannedDoesNotHappen) {
  // Let the script move the plate, while the host keeps it in its place from before that time.
  Flyover world;
  scene::ObjectDesc& plate = world.scenario.objects.back();
  for (const double key_s : {0.0, Flyover::kFromS, Flyover::kToS}) {
    plate.trajectory.push_back({std::llround(key_s * 1e9), world.at(key_s)});
  }
  Session run(world.scenario);
  for (std::int64_t now_s = 7245; now_s <= 7320; ++now_s) {
    if (now_s >= 7258) tell(run, now_s * kSecondNs, world.at(0.0));
    const auto frame = run.frame_k(now_s * kSecondNs, world.eye);
    if (now_s % 5 != 0) continue;
    const double open_k = open_ground_k(world.scenario, now_s * kSecondNs);
    for (std::uint32_t column = 0; column < kWidth; ++column) {
      if (!world.passage(column)) continue;
      EXPECT_NEAR(Flyover::track(frame)[column], open_k, 0.02) << now_s << " s, column " << column;
    }
  }
}

TEST(RendererCachedLive, HeatGoesOnWithoutAStepWhenTheBodyHasStopped) {
  const Flyover world;
  Session run(world.scenario);
  std::vector<float> last;
  std::vector<std::vector<float>> by_column_k(kWidth);
  constexpr double kRestS = 2.0;  // time after which the last edge of the shade has settled
  double now_s = 7245.0;
  for (; now_s <= 7345.0; now_s += 0.25) {
    const std::int64_t now_ns = std::llround(now_s * 1e9);
    tell(run, now_ns, world.at(now_s));
    auto frame = run.frame_k(now_ns, world.eye);
    if (now_s > Flyover::kToS + kRestS) {
      for (std::uint32_t column = 0; column < kWidth; ++column) {
        by_column_k[column].push_back(
            std::abs(Flyover::track(frame)[column] - Flyover::track(last)[column]));
      }
    }
    last = std::move(frame);
  }
  for (std::uint32_t column = 0; column < kWidth; ++column) {
    std::vector<float>& changes_k = by_column_k[column];
    // Expect that changes die away: no change exceeds those right before and after it.
    for (std::size_t i = 2; i + 2 < changes_k.size(); ++i) {
      const float around_k = std::max(std::max(changes_k[i - 2], changes_k[i - 1]),
                                      std::max(changes_k[i + 1], changes_k[i + 2]));
      EXPECT_LT(changes_k[i], around_k + 0.025F) << "column " << column << ", frame " << i;
    }
  }
  // Expect that ground shaded since the stop is as cold as in a run that knows all poses from the
  // start.
  Session fresh(world.scenario);
  const std::int64_t now_ns = std::llround(now_s * 1e9);
  for (double told_s = Flyover::kFromS; told_s < now_s; told_s += 0.25) {
    tell(fresh, std::llround(told_s * 1e9), world.at(told_s));
  }
  const auto anew = fresh.frame_k(now_ns, world.eye);
  const auto ran_on = run.frame_k(now_ns, world.eye);
  EXPECT_LT(difference(anew, ran_on).p99_k, 0.3);
  for (std::uint32_t column = 0; column < kWidth; ++column) {
    if (world.passage(column)) {
      EXPECT_NEAR(Flyover::track(anew)[column], Flyover::track(ran_on)[column], 0.05) << column;
    }
  }
}

TEST(RendererCachedLive, FacesOfABodyThatTheHostTurnsFollowTheSun) {
  // Expect the same temperatures from scripted turns and from live turns at the same time, and from
  // intervals of a second.
  auto live = cached_scenario(write_quads("ground", {ground(12.0, 12.0)}));
  scene::ObjectDesc body = live.objects.front();
  body.name = "body";
  body.gltf = write_quads("body", box({-1.5, -1.5, 0.2}, {1.5, 1.5, 3.0}));
  body.entity_id = 7;
  live.objects.push_back(body);
  auto scripted = live;
  constexpr std::int64_t kBeginNs = 2 * kHourNs + 33 * kSecondNs;
  constexpr std::int64_t kEndNs = kBeginNs + 4 * kSecondNs;
  const auto turned = [&](std::int64_t at_ns) {
    physics::Pose pose = body.instances.front();
    const double frac = std::clamp(
        static_cast<double>(at_ns - kBeginNs) / static_cast<double>(kEndNs - kBeginNs), 0.0, 1.0);
    pose.world_from_body =
        glm::angleAxis(0.5 * physics::kPi * frac, glm::dvec3(0.0, 0.0, 1.0)) * pose.world_from_body;
    return pose;
  };
  for (std::int64_t at_ns = kBeginNs; at_ns <= kEndNs; at_ns += kSecondNs / 4) {
    scripted.objects.back().trajectory.push_back({at_ns, turned(at_ns)});
  }
  const auto pose = looking({6.0, -7.0, 5.0}, {0.0, 0.0, 1.2});
  const auto frames = [&](const scene::ScenarioDesc& scenario, bool by_host) {
    Session session(scenario);
    std::vector<std::vector<float>> out;
    for (std::int64_t now_ns = 2 * kHourNs; now_ns <= kEndNs + 50 * kSecondNs;
         now_ns += kSecondNs / 4) {
      if (by_host) tell(session, now_ns, turned(now_ns));
      auto frame = session.frame_k(now_ns, pose);
      if (now_ns % (5 * kSecondNs) == 0) out.push_back(std::move(frame));
    }
    return out;
  };
  const auto expected = frames(scripted, false);
  const auto seen = frames(live, true);
  const auto never = frames(live, false);
  auto fine = scripted;
  fine.thermal.first_step_s = 1.0;
  const auto truth = frames(fine, false);
  ASSERT_EQ(expected.size(), seen.size());
  ASSERT_EQ(truth.size(), seen.size());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    EXPECT_LT(difference(expected[i], seen[i]).p99_k, 0.15) << i;
    EXPECT_LT(difference(expected[i], truth[i]).p99_k, 0.15) << i;
    EXPECT_LT(difference(seen[i], truth[i]).p99_k, 0.08) << i;
  }
  EXPECT_GT(difference(expected.back(), never.back()).p99_k, 3.0);
}

TEST(RendererCachedLive, ABodyThatTheHostBringsIntoViewHasItsDetailAsIfTheScriptDid) {
  // A box with a fin that shades its lid stands below the view, as far from the camera as the place
  // in view to which it moves.
  auto live = cached_scenario(write_quads("ground", {ground(60.0, 60.0)}));
  auto quads = box({-2.0, -2.0, 0.2}, {2.0, 2.0, 1.2});
  for (const Quad& quad : box({-0.2, -1.5, 1.2}, {0.2, 1.5, 2.7})) quads.push_back(quad);
  scene::ObjectDesc body = live.objects.front();
  body.name = "body";
  body.gltf = write_quads("body", quads);
  body.entity_id = 7;
  constexpr double kBelowM = -18.0;
  constexpr std::int64_t kBeginNs = 2 * kHourNs + 3 * kSecondNs;
  constexpr std::int64_t kEndNs = kBeginNs + 8 * kSecondNs;
  const auto moved = [&](std::int64_t at_ns) {
    physics::Pose pose = live.objects.front().instances.front();
    const double left_frac = std::clamp(
        static_cast<double>(kEndNs - at_ns) / static_cast<double>(kEndNs - kBeginNs), 0.0, 1.0);
    pose.position_world_m.y = kBelowM * left_frac;
    return pose;
  };
  body.instances = {moved(kBeginNs)};
  live.objects.push_back(body);
  auto scripted = live;
  scripted.objects.back().trajectory = {
      {0, moved(kBeginNs)}, {kBeginNs, moved(kBeginNs)}, {kEndNs, moved(kEndNs)}};
  const auto eye = looking({1.0, -9.0, 16.0}, {0.0, 0.0, 1.2});
  const auto last_frame = [&](const scene::ScenarioDesc& scenario, bool by_host) {
    Session session(scenario);
    std::vector<float> frame;
    for (std::int64_t now_ns = 2 * kHourNs; now_ns <= kEndNs + 2 * kSecondNs;
         now_ns += kSecondNs / 4) {
      if (by_host) tell(session, now_ns, moved(now_ns));
      frame = session.frame_k(now_ns, eye);
    }
    return frame;
  };
  const auto by_script = last_frame(scripted, false);
  const auto by_host = last_frame(live, true);
  EXPECT_LT(difference(by_script, by_host).p99_k, 0.3);
}

}  // namespace
}  // namespace emit::test
