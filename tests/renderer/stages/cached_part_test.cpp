// SPDX-License-Identifier: Apache-2.0
// Parts that heat themselves, against the lumped balance of a skin: C dT/dt = P + h (T_air - T).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "emit/physics/constants.hpp"
#include "support/part_plate.hpp"

namespace emit::test {
namespace {

TEST(RendererCachedPart, AnImposedFluxWarmsTheSkinAndItsEndLetsItCool) {
  constexpr double kPowerW_m2 = 300.0;
  constexpr double kOffS = 1200.0;
  const scene::ScenarioDesc s = plate_world(
      {{at_ns(0.0), {PartKind::power, kPowerW_m2}}, {at_ns(kOffS), {PartKind::off, 0.0}}});
  Session run(s);
  EXPECT_NEAR(middle_k(run, 0.0), kAirK, 0.2);
  const double tau_s = kSkinJ_m2K / kFilmW_m2K;
  const double rise_k = kPowerW_m2 / kFilmW_m2K;
  for (double after_s = 5.0; after_s <= 2400.0; after_s += 5.0) {
    const double now_k = middle_k(run, after_s);
    const double warm_s = std::min(after_s, kOffS);
    double expected_k = kAirK + rise_k * (1.0 - std::exp(-warm_s / tau_s));
    expected_k = kAirK + (expected_k - kAirK) * std::exp(-(after_s - warm_s) / tau_s);
    // The foam takes a twentieth of the flux at first.
    EXPECT_NEAR(now_k, expected_k, 0.05 * rise_k) << after_s << " s";
  }
}

TEST(RendererCachedPart, ASkinFollowsTheThrottleOfItsEngine) {
  const scene::PartCurve curve{.given = true,
                               .idle_k = 350.0,
                               .full_k = 450.0,
                               .cold_k = kAirK,
                               .up_s = 120.0,
                               .down_s = 300.0};
  const scene::ScenarioDesc s = plate_world(
      {{at_ns(0.0), {PartKind::throttle, 1.0}}, {at_ns(600.0), {PartKind::off, 0.0}}}, curve);
  Session run(s);
  const double top_k = 450.0 + (kAirK - 450.0) * std::exp(-600.0 / 120.0);
  for (double after_s = 5.0; after_s <= 1200.0; after_s += 5.0) {
    const double expected_k = after_s <= 600.0
                                  ? 450.0 + (kAirK - 450.0) * std::exp(-after_s / 120.0)
                                  : kAirK + (top_k - kAirK) * std::exp(-(after_s - 600.0) / 300.0);
    // Frames interpolate over an interval of 20 s.
    EXPECT_NEAR(middle_k(run, after_s), expected_k, 0.7) << after_s << " s";
  }
}

TEST(RendererCachedPart, AHostsCommandShowsWithinASixteenthOfAnIntervalAndReplacesTheScript) {
  const scene::ScenarioDesc s = plate_world({{at_ns(0.0), {PartKind::temperature, 400.0}},
                                             {at_ns(60.0), {PartKind::temperature, 500.0}}});
  constexpr double kStepS = 1.25;  // of intervals of 20 s
  const renderer::PartUpdate hot{7, 1, {PartKind::temperature, 350.0}};
  const auto frames_k = [&](Session& run) {
    std::vector<double> out;
    for (double after_s = 10.0; after_s <= 80.0; after_s += 0.25) {
      if (after_s == 33.25) {
        EXPECT_TRUE(run.renderer().apply_part(at_ns(33.25), hot));
      }
      out.push_back(middle_k(run, after_s));
    }
    return out;
  };
  std::vector<double> first;
  {
    Session run(s);
    first = frames_k(run);
    std::size_t i = 0;
    for (double after_s = 10.0; after_s <= 80.0; after_s += 0.25, ++i) {
      if (after_s <= 33.25) {
        EXPECT_NEAR(first[i], 400.0, 0.1) << after_s << " s";
      } else if (after_s >= 33.25 + 2.0 * kStepS) {
        EXPECT_NEAR(first[i], 350.0, 0.1) << after_s << " s";
      }
    }
    EXPECT_FALSE(run.renderer().apply_part(at_ns(20.0), hot)) << "before the newest command";
    EXPECT_FALSE(run.renderer().apply_part(at_ns(90.0), {7, 2, hot.command})) << "no such part";
    EXPECT_FALSE(run.renderer().apply_part(at_ns(90.0), {8, 1, hot.command})) << "no such entity";
  }
  // The same commands give the same bits again.
  Session again(s);
  EXPECT_EQ(frames_k(again), first);
}

TEST(RendererCachedPart, AHotUndersideLeavesItsPrintOnTheGround) {
  constexpr double kHotK = 400.0;
  constexpr double kLeavesS = 1200.0;
  constexpr double kEmissivity = 0.9;
  scene::ScenarioDesc s = plate_world({{at_ns(0.0), {PartKind::temperature, kHotK}}});
  // Stand a slab of 4 m x 4 m at 0.3 m above ground that follows within minutes.
  auto slab = box({-2.0, -2.0, 0.3}, {2.0, 2.0, 0.6});
  const Quad under = ground(2.0, 2.0, 0.3);
  slab.push_back({under.d, under.c, under.b, under.a});
  scene::ObjectDesc& body = s.objects.back();
  body.gltf = write_quads("slab", slab);
  physics::Pose stands = body.instances.front();
  stands.position_world_m = glm::dvec3(0.0);
  physics::Pose away = stands;
  away.position_world_m.x += 300.0;
  body.instances = {stands};
  body.trajectory = {{0, stands, true, false},
                     {at_ns(kLeavesS), stands, true, false},
                     {at_ns(kLeavesS + 0.1), away, true, true}};
  for (scene::Material& material : s.materials) {
    material.layers = {{0.001, 200.0, 2700, 900}, {0.5, 0.02, 20, 1000}};
    material.emissivity_frac = kEmissivity;
    material.solar_absorptance_frac = 0.0;
    material.modes.clear();
  }
  Session run(s);
  const physics::Pose eye = looking({0.0, -0.001, 6.0}, {0.0, 0.0, 0.0});
  std::vector<float> frame;
  for (double after_s = 0.0; after_s <= kLeavesS + 2.0; after_s += 2.0) {
    frame = run.frame_k(at_ns(after_s), eye);
  }
  const auto found_k = static_cast<double>(frame[kHeight / 2 * kWidth + kWidth / 2]);
  // Solve the balance of the ground in the middle. The slab fills 0.982 of its view (Howell, a
  // rectangle over its centre), and sends what it emits and a tenth of what the ground sends.
  constexpr double kFilled = 0.982;
  const auto net_w_m2 = [](double t_k) {
    const auto emitted_w_m2 = [](double k) {
      return kEmissivity * physics::kStefanBoltzmannWPerM2K4 * k * k * k * k;
    };
    const double slab_w_m2 = (emitted_w_m2(kHotK) + (1.0 - kEmissivity) * emitted_w_m2(t_k)) /
                             (1.0 - (1.0 - kEmissivity) * (1.0 - kEmissivity));
    return kEmissivity * (kFilled * slab_w_m2 + (1.0 - kFilled) * 400.0) - emitted_w_m2(t_k) +
           kFilmW_m2K * (kAirK - t_k);
  };
  double low_k = kAirK;
  double high_k = kHotK;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low_k + high_k);
    (net_w_m2(middle) > 0.0 ? low_k : high_k) = middle;
  }
  EXPECT_GT(low_k, kAirK + 25.0);
  EXPECT_NEAR(found_k, low_k, 0.05 * (low_k - kAirK));
}

}  // namespace
}  // namespace emit::test
