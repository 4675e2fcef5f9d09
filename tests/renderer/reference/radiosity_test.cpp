// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/radiosity.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "emit/physics/constants.hpp"

namespace emit::reference {
namespace {

/// Cube: each face sees the five others alike, close enough to its true view factors.
struct Cube {
  std::vector<std::size_t> start{0};
  std::vector<PatchLink> links;
  explicit Cube(float open_frac) {
    for (std::uint32_t p = 0; p < 6; ++p) {
      for (std::uint32_t q = 0; q < 6; ++q) {
        if (q != p) links.push_back({q, 0.2F * (1.0F - open_frac)});
      }
      start.push_back(links.size());
    }
  }
};

TEST(Radiosity, AClosedBoxIsBlackWhateverItsEmissivity) {
  const Cube cube(0.0F);
  const double black_w_m2 = physics::kStefanBoltzmannWPerM2K4 * std::pow(400.0, 4.0);
  for (const double emissivity : {0.9, 0.3, 0.1, 0.02}) {
    const std::vector<double> reflect(6, 1.0 - emissivity);
    const std::vector<double> source(6, emissivity * black_w_m2);
    std::vector<double> radiosity(6);
    EXPECT_LE(solve_radiosity({cube.start, cube.links}, reflect, source, radiosity),
              kRadiosityToleranceWM2);
    for (const double w_m2 : radiosity) {
      const double apparent_k = std::pow(w_m2 / physics::kStefanBoltzmannWPerM2K4, 0.25);
      EXPECT_NEAR(apparent_k, 400.0, 1e-3) << emissivity;
    }
  }
}

TEST(Radiosity, PerfectMirrorsLoseThroughTheOpeningAlone) {
  const Cube cube(0.1F);
  const std::vector<double> reflect(6, 1.0);
  const std::vector<double> source(6, 5.0);
  std::vector<double> radiosity(6);
  EXPECT_LE(solve_radiosity({cube.start, cube.links}, reflect, source, radiosity),
            kRadiosityToleranceWM2);
  for (const double w_m2 : radiosity) EXPECT_NEAR(w_m2, 50.0, kRadiosityToleranceWM2);
}

TEST(Radiosity, FaintLightBetweenMirrorsIsFollowedBehindStrongLightThatFades) {
  // Patches 0 and 1 lose much. Patches 2 and 3 face each other and lose a thousandth, and only
  // patch 2 sends: J_2 = 0.01 + 0.999 J_3, J_3 = 0.999 J_2.
  const std::vector<std::size_t> start{0, 1, 2, 3, 4};
  const std::vector<PatchLink> links{{1, 0.5F}, {0, 0.5F}, {3, 1.0F}, {2, 1.0F}};
  const std::vector<double> reflect{0.1, 0.1, 0.999, 0.999};
  std::vector<double> radiosity(4);
  EXPECT_LE(solve_radiosity({start, links}, reflect, std::vector<double>{500.0, 500.0, 0.01, 0.0},
                            radiosity),
            kRadiosityToleranceWM2);
  EXPECT_NEAR(radiosity[0], 500.0 / 0.95, kRadiosityToleranceWM2);
  EXPECT_NEAR(radiosity[2], 0.01 / (1.0 - 0.999 * 0.999), kRadiosityToleranceWM2);
  EXPECT_NEAR(radiosity[3], 0.999 * 0.01 / (1.0 - 0.999 * 0.999), kRadiosityToleranceWM2);
}

TEST(Radiosity, WhatDoesNotFadeIsTold) {
  const Cube cube(0.0F);
  std::vector<double> radiosity(6);
  EXPECT_GT(solve_radiosity({cube.start, cube.links}, std::vector<double>(6, 1.0),
                            std::vector<double>(6, 5.0), radiosity),
            1.0);
}

}  // namespace
}  // namespace emit::reference
