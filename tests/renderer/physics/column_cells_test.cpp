// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/column_cells.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstddef>
#include <random>
#include <vector>

namespace emit::physics {
namespace {

/// Stacks of `least` to `most` layers, from foils to walls and from foam to metal.
std::vector<StackLayer> random_stack(std::mt19937_64& random, std::size_t least, std::size_t most) {
  const auto between = [&random](double low, double high) {
    return low * std::pow(high / low, std::uniform_real_distribution<>(0.0, 1.0)(random));
  };
  std::vector<StackLayer> layers(std::uniform_int_distribution<std::size_t>(least, most)(random));
  for (StackLayer& layer : layers) {
    layer = {between(2e-4, 0.5), between(0.02, 400.0), between(2e4, 4e6)};
  }
  return layers;
}

/// Impedance at the surface of a column, by elimination from the base upwards.
std::complex<double> impedance_m2k_w(const ColumnCells& cells, double angular_rad_s) {
  std::complex<double> below = 0.0;  // of the base
  for (std::size_t l = cells.count; l-- > 0;) {
    const std::complex<double> inner = below + 1.0 / cells.below_w_m2_k(l);
    below = 1.0 / (std::complex<double>(0.0, angular_rad_s * cells.heat_j_m2_k[l]) + 1.0 / inner);
  }
  return below + 1.0 / cells.surface_w_m2_k();
}

TEST(ColumnCells, HoldTheWholeStackAndKeepItsLayersApart) {
  std::mt19937_64 random(11);
  for (int n = 0; n < 500; ++n) {
    const auto layers = random_stack(random, 1, 12);
    const ColumnCells cells = column_cells(layers);
    ASSERT_EQ(cells.count, kMaxColumnCells);
    double thickness_m = 0.0;
    double heat_j_m2_k = 0.0;
    double resistance_m2k_w = 0.0;
    for (const StackLayer& layer : layers) {
      thickness_m += layer.thickness_m;
      heat_j_m2_k += layer.thickness_m * layer.volumetric_heat_j_m3_k;
      resistance_m2k_w += layer.thickness_m / layer.conductivity_w_m_k;
      if (layers.size() > kMaxColumnCells) continue;
      // An end of a cell lies at the lower face of every layer.
      double nearest_m = 1.0;
      for (const double top_m : cells.top_m) {
        nearest_m = std::min(nearest_m, std::abs(top_m - thickness_m));
      }
      EXPECT_LT(nearest_m, 1e-9 * thickness_m) << n;
    }
    for (std::size_t l = 0; l < cells.count; ++l) {
      EXPECT_GT(cells.thickness_m(l), 0.0);
      EXPECT_GT(cells.conductivity_w_m_k[l], 0.0);
      EXPECT_EQ(cells.at(cells.middle_m(l)), l);
      heat_j_m2_k -= cells.heat_j_m2_k[l];
      resistance_m2k_w -= cells.resistance_m2k_w[l];
    }
    EXPECT_NEAR(cells.top_m[cells.count], thickness_m, 1e-9 * thickness_m);
    EXPECT_NEAR(heat_j_m2_k, 0.0, 1e-6);
    EXPECT_NEAR(resistance_m2k_w, 0.0, 1e-9);
  }
}

TEST(ColumnCells, AnswerLikeTheStackOverHoursAndDays) {
  std::mt19937_64 random(12);
  double sum = 0.0;
  double worst = 0.0;
  constexpr int kStacks = 200;
  for (int n = 0; n < kStacks; ++n) {
    const auto layers = random_stack(random, 1, 3);
    const ColumnCells cells = column_cells(layers);
    for (const double period_s : {7200.0, 86400.0}) {
      const double w = 2.0 * kPi / period_s;
      // Compare temperatures per absorbed flux, with losses of 19 W m-2 K-1.
      const auto per_flux = [](std::complex<double> z) { return 1.0 / (19.0 + 1.0 / z); };
      const std::complex<double> wanted = per_flux(stack_impedance_m2k_w(layers, w));
      const double off = std::abs(per_flux(impedance_m2k_w(cells, w)) - wanted) / std::abs(wanted);
      sum += off / (2.0 * kStacks);
      worst = std::max(worst, off);
    }
  }
  EXPECT_LT(sum, 0.02);
  EXPECT_LT(worst, 0.15);
}

}  // namespace
}  // namespace emit::physics
