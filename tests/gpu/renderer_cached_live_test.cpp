// SPDX-License-Identifier: Apache-2.0
// Entities that the host drives: their shade is where they are, not where they were when the rays
// of an interval were sent.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "gpu/cached_session.hpp"

namespace emit::test {
namespace {

/// Tells where entity 7 is.
void tell(Session& session, std::int64_t sim_time_ns, const physics::Pose& pose) {
  const renderer::EntityUpdate update{7, pose, true, false};
  EXPECT_EQ(session.renderer().apply_entities(sim_time_ns, {&update, 1}), 1U);
}

/// A plate flies over squares of ground at constant speed, south to north in the middle column.
struct Flyover {
  static constexpr double kHalfLengthM = 4.0;
  static constexpr double kHeightM = 10.0;
  static constexpr double kSpeedMs = 1.0;
  static constexpr double kOverOriginS = 7270.0;  ///< the middle of its shade is
  static constexpr double kFromS = 7235.0;
  static constexpr double kToS = 7305.0;
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
  /// Column of the track to metres from the origin.
  [[nodiscard]] double track_m(std::uint32_t column) const {
    const double px_m = 2.0 * kEyeM * std::tan(0.5 * scenario.sensor.fov_h_rad) / kWidth;
    return (column + 0.5 - 0.5 * kWidth) * px_m;
  }
};

TEST(RendererCachedLive, ShadeGoesWithABodyThatTheHostMoves) {
  const Flyover world;
  Session run(world.scenario);
  constexpr double kStepS = 0.25;
  int compared = 0;
  for (double now_s = 7221.0; now_s <= 7330.0; now_s += kStepS) {
    const std::int64_t now_ns = std::llround(now_s * 1e9);
    tell(run, now_ns, world.at(now_s));
    const auto frame = run.frame_k(now_ns, world.eye);
    if (std::abs(std::remainder(now_s, 9.0)) > 0.1) continue;
    const float* track_k = &frame[std::size_t{kHeight} / 2 * kWidth];
    for (std::uint32_t column = 4; column < kWidth; column += 7) {
      const double middle_s = Flyover::kOverOriginS + world.track_m(column) / Flyover::kSpeedMs;
      constexpr double kHalfS = Flyover::kHalfLengthM / Flyover::kSpeedMs;
      const double in_s = middle_s - kHalfS;
      const double out_s = middle_s + kHalfS;
      // The place where it waits, and those where it stops, are in its shade for longer.
      if (in_s < Flyover::kFromS || out_s > Flyover::kToS) continue;
      const double expected_k =
          now_s <= in_s ? open_ground_k(world.scenario, now_ns)
                        : open_ground_k(world.scenario, now_ns, Shade{in_s, std::min(out_s, now_s)});
      // Edges of the shade are a mean over a step, which is where most of the difference is.
      const double nearest_s = std::min(std::abs(now_s - in_s), std::abs(now_s - out_s));
      EXPECT_NEAR(track_k[column], expected_k, nearest_s < 2.0 ? 0.3 : 0.1)
          << now_s << " s, column " << column << ", shade " << in_s << " to " << out_s;
      ++compared;
    }
  }
  EXPECT_GT(compared, 60);
}

}  // namespace
}  // namespace emit::test
