// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "emit/physics/atmosphere_table.hpp"
#include "emit/physics/constants.hpp"

namespace emit::physics {
namespace {

constexpr double kAirRadiance = 30.0;

/// Returns a grid of homogeneous air: an extinction per metre for each elevation, and the path
/// radiance (1 - tau) L.
AtmosphereGrid homogeneous(const std::vector<double>& range_m,
                           const std::vector<double>& extinction_per_m) {
  AtmosphereGrid grid;
  grid.range_m = range_m;
  for (std::size_t e = 0; e < extinction_per_m.size(); ++e) {
    grid.elevation_rad.push_back((-30.0 + 40.0 * static_cast<double>(e)) * kDegree);
    for (const double range : range_m) {
      const double tau = std::exp(-extinction_per_m[e] * range);
      grid.transmittance_frac.push_back(tau);
      grid.path_radiance_w_m2_sr.push_back((1.0 - tau) * kAirRadiance);
    }
  }
  return grid;
}

TEST(AtmosphereTable, FollowsBeerAndLambertExactlyBetweenCoarseRanges) {
  const auto table = AtmosphereTable::build(homogeneous({500.0, 9000.0}, {2e-4, 2e-4}));
  ASSERT_TRUE(table.has_value()) << table.error().text;
  for (const double range : {0.0, 1.0, 250.0, 500.0, 4000.0, 8999.0, 9000.0}) {
    const auto air = table->along(range, std::sin(-3.0 * kDegree));
    const double tau = std::exp(-2e-4 * range);
    EXPECT_NEAR(air.transmittance_frac, tau, 1e-14) << range;
    EXPECT_NEAR(air.path_radiance_w_m2_sr, (1.0 - tau) * kAirRadiance, 1e-12) << range;
    EXPECT_FALSE(air.clamped) << range;
  }
}

TEST(AtmosphereTable, GivesTheGridAtItsPointsAndLiesBetweenThemElsewhere) {
  const auto grid = homogeneous({0.0, 100.0, 1000.0, 5000.0}, {5e-4, 1e-4, 2e-5});
  const auto table = AtmosphereTable::build(grid);
  ASSERT_TRUE(table.has_value()) << table.error().text;
  for (std::size_t e = 0; e < 3; ++e) {
    for (std::size_t r = 0; r < 4; ++r) {
      const auto air = table->along(grid.range_m[r], std::sin(grid.elevation_rad[e]));
      EXPECT_NEAR(air.transmittance_frac, grid.transmittance_frac[e * 4 + r], 1e-14);
      EXPECT_NEAR(air.path_radiance_w_m2_sr, grid.path_radiance_w_m2_sr[e * 4 + r], 1e-12);
    }
  }
  double before_tau = 1.0;
  double before_path = 0.0;
  for (double range = 0.0; range <= 5000.0; range += 12.5) {
    const auto air = table->along(range, std::sin(-11.0 * kDegree));
    EXPECT_LE(air.transmittance_frac, before_tau) << range;
    EXPECT_GE(air.path_radiance_w_m2_sr, before_path) << range;
    before_tau = air.transmittance_frac;
    before_path = air.path_radiance_w_m2_sr;
  }
  // Half way between two elevations in sine, the transmittance is the geometric mean.
  const double middle = 0.5 * (std::sin(-30.0 * kDegree) + std::sin(10.0 * kDegree));
  EXPECT_NEAR(table->along(1000.0, middle).transmittance_frac,
              std::sqrt(std::exp(-0.5) * std::exp(-0.1)), 1e-14);
}

TEST(AtmosphereTable, ClampsAndReportsOutsideTheGrid) {
  const auto table = AtmosphereTable::build(homogeneous({100.0, 1000.0}, {5e-4, 1e-4}));
  ASSERT_TRUE(table.has_value());
  const double level = std::sin(0.0);
  EXPECT_FALSE(table->along(1000.0, level).clamped);
  const auto far = table->along(1e6, level);
  EXPECT_TRUE(far.clamped);
  EXPECT_EQ(far.transmittance_frac, table->along(1000.0, level).transmittance_frac);
  const auto steep = table->along(500.0, 1.0);
  EXPECT_TRUE(steep.clamped);
  EXPECT_NEAR(steep.transmittance_frac, std::exp(-1e-4 * 500.0), 1e-14);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(table->along(nan, level).clamped);
  EXPECT_EQ(table->along(nan, level).transmittance_frac, 1.0);
  EXPECT_TRUE(table->along(-1.0, level).clamped);
}

TEST(AtmosphereTable, OneElevationHoldsForAll) {
  const auto table = AtmosphereTable::build(homogeneous({1000.0}, {1e-4}));
  ASSERT_TRUE(table.has_value());
  for (const double sine : {-1.0, 0.0, 1.0}) {
    EXPECT_NEAR(table->along(500.0, sine).transmittance_frac, std::exp(-0.05), 1e-14);
    EXPECT_FALSE(table->along(500.0, sine).clamped);
  }
  // The sky is the air of the last range.
  EXPECT_NEAR(table->out(0.5).path_radiance_w_m2_sr, (1.0 - std::exp(-0.1)) * kAirRadiance, 1e-12);
}

TEST(AtmosphereTable, OpaqueAirStaysFinite) {
  AtmosphereGrid grid;
  grid.range_m = {100.0, 1000.0};
  grid.elevation_rad = {0.0};
  grid.transmittance_frac = {0.5, 0.0};
  grid.path_radiance_w_m2_sr = {10.0, 20.0};
  const auto table = AtmosphereTable::build(grid);
  ASSERT_TRUE(table.has_value()) << table.error().text;
  const auto air = table->along(999.0, 0.0);
  EXPECT_GT(air.transmittance_frac, 0.0);
  EXPECT_LT(air.transmittance_frac, 1e-29);
  EXPECT_NEAR(air.path_radiance_w_m2_sr, 20.0, 1e-6);
  for (const float node : table->shader_nodes()) EXPECT_TRUE(std::isfinite(node));
}

TEST(AtmosphereTable, RefusesWhatIsNoGridOfAir) {
  const auto error = [](auto change) {
    AtmosphereGrid grid = homogeneous({0.0, 100.0, 1000.0}, {5e-4, 1e-4});
    change(grid);
    const auto table = AtmosphereTable::build(grid);
    return table.has_value() ? std::string() : table.error().text;
  };
  EXPECT_EQ(error([](AtmosphereGrid&) {}), "");
  EXPECT_NE(error([](AtmosphereGrid& g) { g.range_m[2] = 100.0; }).find("not above"),
            std::string::npos);
  EXPECT_NE(error([](AtmosphereGrid& g) { g.elevation_rad[1] = -1.0; }).find("not above"),
            std::string::npos);
  EXPECT_NE(error([](AtmosphereGrid& g) { g.transmittance_frac.pop_back(); }).find("5 trans"),
            std::string::npos);
  EXPECT_NE(error([](AtmosphereGrid& g) { g.transmittance_frac[2] = 0.99; }).find("rises at range"),
            std::string::npos);
  EXPECT_NE(error([](AtmosphereGrid& g) { g.transmittance_frac[0] = 0.99; }).find("must be 1"),
            std::string::npos);
  EXPECT_NE(error([](AtmosphereGrid& g) {
              g.path_radiance_w_m2_sr[4] = std::numeric_limits<double>::quiet_NaN();
            }).find("at range 100 m, elevation 10 deg"),
            std::string::npos);
  EXPECT_NE(error([](AtmosphereGrid& g) { g = {}; }).find("no ranges"), std::string::npos);
}

}  // namespace
}  // namespace emit::physics
