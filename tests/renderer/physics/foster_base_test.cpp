// SPDX-License-Identifier: Apache-2.0
// A base whose temperature changes, against finite differences through the layers.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "emit/physics/foster.hpp"

namespace emit::physics {
namespace {

/// Ten cells in each layer of a stack, outermost first, over a base; implicit Euler.
class Cells {
 public:
  explicit Cells(std::span<const StackLayer> layers) {
    constexpr int kPerLayer = 10;
    for (const StackLayer& layer : layers) {
      for (int i = 0; i < kPerLayer; ++i) {
        half_m2k_w_.push_back(0.5 * layer.thickness_m / kPerLayer / layer.conductivity_w_m_k);
        heat_j_m2_k_.push_back(layer.thickness_m / kPerLayer * layer.volumetric_heat_j_m3_k);
      }
    }
    k_.assign(half_m2k_w_.size(), 0.0);
  }
  /// Advances by `dt_s` under a flux into the surface. Returns the flux into the base.
  double step(double flux_w_m2, double base_k, double dt_s) {
    // Eliminate from the surface inwards: k[i] = a[i] + b[i] k[i + 1].
    const std::size_t count = k_.size();
    std::vector<double> a(count);
    std::vector<double> b(count);
    for (std::size_t i = 0; i < count; ++i) {
      const double stored = heat_j_m2_k_[i] / dt_s;
      const double down = 1.0 / (half_m2k_w_[i] + (i + 1 < count ? half_m2k_w_[i + 1] : 0.0));
      const double up = i > 0 ? 1.0 / (half_m2k_w_[i] + half_m2k_w_[i - 1]) : 0.0;
      const double diagonal = stored + down + up * (1.0 - (i > 0 ? b[i - 1] : 0.0));
      a[i] = (stored * k_[i] + (i > 0 ? up * a[i - 1] : flux_w_m2)) / diagonal;
      b[i] = down / diagonal;
    }
    for (std::size_t i = count; i-- > 0;)
      k_[i] = a[i] + b[i] * (i + 1 < count ? k_[i + 1] : base_k);
    return (k_.back() - base_k) / half_m2k_w_.back();
  }
  [[nodiscard]] double surface_k(double flux_w_m2) const {
    return k_.front() + flux_w_m2 * half_m2k_w_.front();
  }

 private:
  std::vector<double> half_m2k_w_;
  std::vector<double> heat_j_m2_k_;
  std::vector<double> k_;
};

/// Rubber and steel over the film of air inside of a body.
const std::vector<std::vector<StackLayer>> kStacks = {
    {{0.02, 0.16, 1150.0 * 1900.0}, {0.02, 0.1, 1.2 * 1005.0}},
    {{0.0015, 50.0, 7850.0 * 470.0}, {0.02, 0.16, 1.2 * 1005.0}}};

TEST(FosterBase, a_slow_base_is_followed_in_full_and_a_fast_one_hardly) {
  for (const auto& layers : kStacks) {
    EXPECT_NEAR(std::abs(stack_transfer(layers, 0.0) - 1.0), 0.0, 1e-12);
    EXPECT_NEAR(std::abs(stack_transfer(layers, 2.0 * std::numbers::pi / 3e7) - 1.0), 0.0, 5e-3);
    EXPECT_LT(std::abs(stack_transfer(layers, 2.0 * std::numbers::pi / 60.0)), 0.1);
  }
  const std::vector<StackLayer> thick = {{50.0, 1.0, 2e6}};
  EXPECT_EQ(stack_transfer(thick, 1.0), 0.0);
}

TEST(FosterBase, shares_add_up_to_one) {
  for (const auto& layers : kStacks) {
    for (const std::size_t modes : {1U, 2U, 4U}) {
      const auto network = network_of_stack(layers, {.modes = modes});
      ASSERT_TRUE(network.has_value());
      const auto shares = base_shares(layers, *network);
      EXPECT_NEAR((shares[0] + shares[1]) + (shares[2] + shares[3]), 1.0, 1e-9);
      if (network->count > 1) continue;
      EXPECT_EQ(shares[0], 1.0);
    }
  }
}

/// The base warms within half an hour while the surface receives a flux for the first hour.
TEST(FosterBase, modes_follow_layers_over_a_base_that_warms) {
  for (const auto& layers : kStacks) {
    const auto network = network_of_stack(layers);
    ASSERT_TRUE(network.has_value());
    const auto shares = base_shares(layers, *network);
    Cells cells(layers);
    FosterState<double> w{};
    constexpr double kStepS = 1.0;
    double worst_surface_k = 0.0;
    double worst_flux_w_m2 = 0.0;
    for (int i = 0; i < 3 * 3600; ++i) {
      const double t_s = i * kStepS;
      const double base_k = 20.0 * std::min(1.0, t_s / 1800.0);
      const double flux_w_m2 = t_s < 3600.0 ? 100.0 : 0.0;
      const double into_base_w_m2 = cells.step(flux_w_m2, base_k, kStepS);
      double surface_k = 0.0;
      double modes_w_m2 = 0.0;
      for (std::size_t m = 0; m < network->count; ++m) {
        const NetworkMode& mode = network->modes[m];
        w[m] += (mode.resistance_m2k_w * flux_w_m2 + shares[m] * base_k - w[m]) *
                -std::expm1(-kStepS / mode.tau_s);
        surface_k += w[m];
        modes_w_m2 += shares[m] * (w[m] - shares[m] * base_k) / mode.resistance_m2k_w;
      }
      if (std::fmod(t_s, 3600.0) < 300.0) continue;  // a sudden flux needs faster modes
      worst_surface_k = std::max(worst_surface_k, std::abs(surface_k - cells.surface_k(flux_w_m2)));
      worst_flux_w_m2 = std::max(worst_flux_w_m2, std::abs(modes_w_m2 - into_base_w_m2));
    }
    EXPECT_LT(worst_surface_k, 0.3);
    EXPECT_LT(worst_flux_w_m2, 3.0);
  }
}

}  // namespace
}  // namespace emit::physics
