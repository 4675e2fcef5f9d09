// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/conduction_column.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstddef>
#include <random>
#include <vector>

namespace emit::physics {
namespace {

/// Stacks of up to four layers, from foils to walls and from foam to metal.
std::vector<StackLayer> random_stack(std::mt19937_64& random) {
  const auto between = [&random](double low, double high) {
    return low * std::pow(high / low, std::uniform_real_distribution<>(0.0, 1.0)(random));
  };
  std::vector<StackLayer> layers(std::uniform_int_distribution<std::size_t>(1, 4)(random));
  for (StackLayer& layer : layers) {
    layer = {between(2e-4, 0.5), between(0.02, 400.0), between(2e4, 4e6)};
  }
  return layers;
}

/// Impedance of a column at its surface, by elimination from the base upwards.
std::complex<double> impedance_m2k_w(const ConductionColumn& column, double angular_rad_s) {
  std::complex<double> below = 0.0;  // of the base
  for (std::size_t l = column.count; l-- > 0;) {
    const std::complex<double> inner = below + 1.0 / column.conductance_w_m2_k[l];
    below = 1.0 / (std::complex<double>(0.0, angular_rad_s * column.heat_j_m2_k[l]) + 1.0 / inner);
  }
  return below;
}

TEST(ConductionColumn, AnswersAsItsNetworkAndHasPositiveEntries) {
  std::mt19937_64 random(11);
  for (int n = 0; n < 500; ++n) {
    const auto layers = random_stack(random);
    const auto network = network_of_stack(layers);
    ASSERT_TRUE(network) << n;
    const ConductionColumn column = column_of_network(*network);
    for (std::size_t l = 0; l < column.count; ++l) {
      EXPECT_GT(column.heat_j_m2_k[l], 0.0) << n;
      EXPECT_GT(column.conductance_w_m2_k[l], 0.0) << n;
    }
    for (const double period_s : {600.0, 7200.0, 86400.0}) {
      const double w = 2.0 * kPi / period_s;
      const std::complex<double> wanted = network_impedance_m2k_w(*network, w);
      EXPECT_LT(std::abs(impedance_m2k_w(column, w) - wanted), 1e-6 * std::abs(wanted)) << n;
    }
  }
}

TEST(ConductionColumn, AndItsModesAreOneSystem) {
  std::mt19937_64 random(12);
  for (int n = 0; n < 500; ++n) {
    const auto layers = random_stack(random);
    const auto network = network_of_stack(layers);
    ASSERT_TRUE(network) << n;
    const ConductionColumn whole = column_of_network(*network);
    double depth_m = 0.0;
    for (const StackLayer& layer : layers) depth_m += layer.thickness_m;
    for (const double cut_frac : {0.02, 0.1, 0.5, 2.0}) {
      const ConductionColumn column = cut_column(layers, whole, cut_frac * depth_m);
      const ColumnModes modes = modes_of_column(column);
      ASSERT_EQ(modes.network.count, column.count);
      double shares = 0.0;
      for (std::size_t i = 0; i < column.count; ++i) {
        EXPECT_GT(modes.network.modes[i].tau_s, 0.0);
        EXPECT_GT(modes.network.modes[i].resistance_m2k_w, 0.0);
        EXPECT_NEAR(modes.lump_from_mode[0][i], 1.0, 1e-9);
        shares += modes.base_shares[i];
      }
      // A base that stays warmer for ever warms the surface as much.
      EXPECT_NEAR(shares, 1.0, 1e-6) << n;
      for (const double period_s : {600.0, 86400.0}) {
        const double w = 2.0 * kPi / period_s;
        const std::complex<double> wanted = impedance_m2k_w(column, w);
        EXPECT_LT(std::abs(network_impedance_m2k_w(modes.network, w) - wanted),
                  1e-6 * std::abs(wanted))
            << n << " " << cut_frac;
      }
    }
  }
}

TEST(ConductionColumn, HoldsTheMaterialOfItsStackOnce) {
  std::mt19937_64 random(13);
  for (int n = 0; n < 200; ++n) {
    const auto layers = random_stack(random);
    const auto network = network_of_stack(layers);
    ASSERT_TRUE(network) << n;
    const ConductionColumn column = column_of_network(*network);
    const ColumnDepths depths = depths_of_column(layers, column);
    double total_w_k = 0.0;
    double depth_m = 0.0;
    for (const StackLayer& layer : layers) {
      total_w_k += layer.thickness_m * layer.conductivity_w_m_k;
      depth_m += layer.thickness_m;
    }
    double sum_w_k = 0.0;
    double above_m = 0.0;
    for (std::size_t l = 0; l < column.count; ++l) {
      sum_w_k += depths.sideways_w_k[l];
      EXPECT_GE(depths.depth_m[l], 0.0);
      EXPECT_LE(depths.depth_m[l], depth_m);
      if (depths.sideways_w_k[l] > 0.0) {
        EXPECT_GE(depths.depth_m[l], above_m * (1.0 - 1e-9)) << n;
        above_m = depths.depth_m[l];
      }
    }
    // The base has the rest.
    EXPECT_LE(sum_w_k, total_w_k * (1.0 + 1e-9)) << n;
    EXPECT_GT(sum_w_k, 0.0) << n;
  }
}

}  // namespace
}  // namespace emit::physics
