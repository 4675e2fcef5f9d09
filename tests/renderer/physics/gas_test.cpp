// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/physics/gas/jet.hpp"
#include "emit/physics/gas/puff.hpp"
#include "emit/physics/gas/spectrum.hpp"

/// Spectra of hot gas, jets and puffs against published correlations and quadrature.
namespace emit::physics {
namespace {

/// Total emissivity of carbon dioxide or water vapour in the limit of zero partial pressure at 1
/// bar, by Leckner (1972) as Modest prints it (Radiative Heat Transfer, table 10.5): ln eps = sum
/// c_ji (T / 1000 K)^j (log10 of p L in bar cm)^i.
double leckner_emissivity(bool water, double kelvin, double bar_cm) {
  using Rows = std::vector<std::vector<double>>;
  static const Rows kWater{
      {-2.2118, -1.1987, 0.035596}, {0.85667, 0.93048, -0.14391}, {-0.10838, -0.17156, 0.045915}};
  static const Rows kCarbon{{-3.9893, 2.7669, -2.1081, 0.39163},
                            {1.2710, -1.1090, 1.0195, -0.21897},
                            {-0.23678, 0.19731, -0.19544, 0.044644}};
  const Rows& rows = water ? kWater : kCarbon;
  double sum = 0.0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (std::size_t j = 0; j < rows[i].size(); ++j) {
      sum += rows[i][j] * std::pow(kelvin / 1000.0, static_cast<double>(j)) *
             std::pow(std::log10(bar_cm), static_cast<double>(i));
    }
  }
  return std::exp(sum);
}

TEST(GasSpectrum, TotalEmissivityIsThatOfLecknersChart) {
  const Band all{1.2, 200.0, {}};
  double squares = 0.0;
  int count = 0;
  for (const bool water : {false, true}) {
    for (const double kelvin : {600.0, 1000.0, 1500.0, 2000.0}) {
      for (const double bar_cm : {1.0, 4.0, 10.0, 40.0, 100.0}) {
        constexpr double kFrac = 0.01;
        GasState gas{.mixture = {}, .kelvin = kelvin, .pressure_pa = 1e5};
        (water ? gas.mixture.h2o_frac : gas.mixture.co2_frac) = kFrac;
        const double model = gas_absorptance(gas, all, kelvin, bar_cm / kFrac * 0.01);
        const double chart = leckner_emissivity(water, kelvin, bar_cm);
        squares += std::pow(model / chart - 1.0, 2);
        ++count;
        EXPECT_NEAR(model / chart, 1.0, 0.22)
            << (water ? "water " : "carbon dioxide ") << kelvin << " K, " << bar_cm
            << " bar cm: " << model << ", chart " << chart;
      }
    }
  }
  const double rms = std::sqrt(squares / count);
  EXPECT_LT(rms, 0.13);
  RecordProperty("rms_frac", std::to_string(rms));
}

TEST(GasSpectrum, OfTheMidWaveBandsOnlyThatOfCarbonDioxideIsOpaque) {
  const GasState gas{.mixture = {0.1, 0.1}, .kelvin = 1200.0};
  EXPECT_LT(gas_transmittance(gas, 1e4 / 4.4, 1.0), 0.05);   // 4.3 um band
  EXPECT_GT(gas_transmittance(gas, 1e4 / 3.9, 1.0), 0.9);    // window
  EXPECT_GT(gas_transmittance(gas, 1e4 / 10.0, 1.0), 0.85);  // long-wave window
}

TEST(GasBand, TermsFollowTheAbsorptanceFromThinToThick) {
  for (const auto& [lo, hi] : {std::pair{3.0, 5.0}, {8.0, 12.0}, {3.4, 4.1}, {4.2, 4.6}}) {
    const Band band{lo, hi, {}};
    const GasState gas{.mixture = {0.08, 0.08}, .kelvin = 1000.0};
    const auto terms = GasBand::build(band, gas);
    ASSERT_TRUE(terms);
    double share = 0.0;
    double mean_depth = 0.0;
    for (std::size_t t = 0; t < kGasTerms; ++t) {
      EXPECT_GE(terms->share_frac()[t], 0.0);
      share += terms->share_frac()[t];
      mean_depth += terms->share_frac()[t] * terms->depth()[t];
    }
    EXPECT_NEAR(share, 1.0, 1e-12);
    EXPECT_NEAR(mean_depth, 1.0, 1e-9);
    // Compare with the spectrum itself over columns from 1 cm to 30 m.
    const auto mean = terms->mean_per_m_atm(gas.kelvin);
    const double per_m = gas.mixture.co2_frac * mean[0] + gas.mixture.h2o_frac * mean[1];
    double worst = 0.0;
    for (double path_m = 0.01; path_m < 30.0; path_m *= 2.0) {
      double sum = 0.0;
      for (std::size_t t = 0; t < kGasTerms; ++t) {
        sum -= terms->share_frac()[t] * std::expm1(-terms->depth()[t] * per_m * path_m);
      }
      worst = std::max(worst, std::abs(sum / gas_absorptance(gas, band, gas.kelvin, path_m) - 1.0));
    }
    EXPECT_LT(worst, 0.08) << lo << " to " << hi << " um";
    EXPECT_LT(terms->fit_error_frac(), 0.08) << lo << " to " << hi << " um";
  }
}

TEST(GasBand, RefusesABandThatIsNone) {
  EXPECT_FALSE(GasBand::build({5.0, 3.0, {}}, {}));
}

std::vector<JetNode> nodes_of(const JetExit& exit, const JetAir& air, double last_frac = 0.02) {
  std::vector<JetNode> nodes(200);
  jet_nodes(exit, air, last_frac, nodes);
  return nodes;
}

TEST(Jet, FarFromTheNozzleDecaysAndSpreadsAsMeasured) {
  // Measured in round jets of air: a passive scalar on the axis is 5.0 to 5.6 D / x, and falls to
  // half at 0.11 to 0.13 x from the axis (Dowling and Dimotakis 1990; Pope, Turbulent Flows, ch.
  // 5).
  const auto nodes = nodes_of({.radius_m = 0.5, .speed_m_s = 50.0, .kelvin = 300.0},
                              {.kelvin = 300.0, .along_m_s = 0.0});
  const JetNode& far = nodes.back();
  EXPECT_NEAR(far.exhaust_frac * far.from_nozzle_m, 5.3, 0.3);
  const double half_m = far.sigma_m * std::sqrt(2.0 * std::log(2.0));
  EXPECT_NEAR(half_m / far.from_nozzle_m, 0.12, 0.012);
  EXPECT_GT(far.from_nozzle_m, 100.0);
}

TEST(Jet, KeepsItsExhaustGas) {
  // Exhaust that is nearly as fast as the air only spreads: its mass by length stays the same.
  const JetExit exit{.radius_m = 0.4, .speed_m_s = 600.0, .kelvin = 900.0};
  const JetAir air{.kelvin = 270.0, .along_m_s = 590.0};
  for (const JetNode& node : nodes_of(exit, air)) {
    double mass = 0.0;
    constexpr int kRings = 4000;
    const double edge_m = 7.0 * node.sigma_m;
    for (int i = 0; i < kRings; ++i) {
      const double radius_m = edge_m * (i + 0.5) / kRings;
      const double frac = node.exhaust_frac * std::exp(-0.5 * std::pow(radius_m / node.sigma_m, 2));
      mass += frac / jet_k(exit, air, frac) * 2.0 * kPi * radius_m * edge_m / kRings;
    }
    const double nozzle = kPi * exit.radius_m * exit.radius_m / exit.kelvin;
    EXPECT_NEAR(mass / nozzle, 1.0, 0.02) << node.from_nozzle_m;
  }
}

TEST(Jet, MixesMoreSlowlyInFasterAir) {
  const JetExit exit{.radius_m = 0.5, .speed_m_s = 500.0, .kelvin = 800.0};
  double last_m = 0.0;
  for (const double along_m_s : {0.0, 100.0, 200.0, 300.0}) {
    const double length_m =
        nodes_of(exit, {.kelvin = 280.0, .along_m_s = along_m_s}, 0.05).back().from_nozzle_m;
    EXPECT_GT(length_m, last_m);
    last_m = length_m;
  }
  // A jet exactly as fast as the air mixes too, and one that is slower.
  for (const double along_m_s : {500.0, 800.0}) {
    for (const JetNode& node : nodes_of(exit, {.kelvin = 280.0, .along_m_s = along_m_s})) {
      EXPECT_TRUE(std::isfinite(node.from_nozzle_m) && node.sigma_m > 0.0 && node.speed_m_s > 0.0);
    }
  }
}

TEST(Flame, HasTheHeightOfHeskestad) {
  // A pool of 1.6 m with 2.5 MW: 0.235 * 2500^0.4 - 1.02 * 1.6.
  EXPECT_NEAR(flame_height_m(2.5e6, 1.6), 3.74, 0.01);
  EXPECT_EQ(flame_height_m(1e3, 5.0), 0.0);
}

TEST(GasPuff, ErrorFunctionIsWithinItsBound) {
  for (float x = -6.0F; x <= 6.0F; x += 0.01F) {
    EXPECT_NEAR(gas_erf(x), std::erf(double{x}), 4e-7);
  }
}

TEST(GasPuff, LineHasTheColumnOfItsDensity) {
  const glm::vec3 middle_m(3.0F, -2.0F, 40.0F);
  const glm::vec3 axis = glm::normalize(glm::vec3(1.0F, 0.5F, 2.0F));
  const float across_m = 1.5F;
  const float along_m = 4.0F;
  const float per_across = 1.0F / (across_m * across_m);
  const float per_along = 1.0F / (along_m * along_m);
  for (const float x : {-0.1F, 0.0F, 0.06F, 0.2F}) {
    const glm::vec3 ray = glm::normalize(glm::vec3(x, -0.05F, 1.0F));
    const GasLine line = gas_line(ray, middle_m, per_across, axis, per_along);
    for (const float surface_m : {20.0F, 39.0F, 41.0F, 300.0F}) {
      double column = 0.0;
      constexpr int kSteps = 20000;
      const double end_m = std::min(surface_m, 100.0F);
      for (int i = 0; i < kSteps; ++i) {
        const glm::dvec3 p = glm::dvec3(ray) * (end_m * (i + 0.5) / kSteps) - glm::dvec3(middle_m);
        const double axial = glm::dot(p, glm::dvec3(axis));
        const double radial2 = glm::dot(p, p) - axial * axial;
        column += std::exp(-0.5 * (radial2 / (across_m * across_m) +
                                   axial * axial / (along_m * along_m))) *
                  end_m / kSteps;
      }
      const double model = std::exp(-0.5 * line.square) * std::sqrt(2.0 * kPi) * line.sigma_m *
                           gas_before(line.place_m / line.sigma_m, surface_m / line.sigma_m);
      EXPECT_NEAR(model, column, 2e-4 * std::max(1.0, column)) << x << " " << surface_m;
    }
  }
}

TEST(GasPuff, LineAlongALongThinPuffKeepsItsDigits) {
  // Looked at along the axis, the standard deviation along the line is that of the axis.
  for (const float along_m : {10.0F, 300.0F, 3000.0F, 30'000.0F}) {
    const glm::vec3 axis = glm::normalize(glm::vec3(0.3F, -0.2F, 1.0F));
    const GasLine line = gas_line(axis, 500.0F * axis, 1.0F, axis, 1.0F / (along_m * along_m));
    EXPECT_NEAR(line.sigma_m / along_m, 1.0F, 1e-2F) << along_m;
    EXPECT_NEAR(line.place_m, 500.0F, 1.0F) << along_m;
    EXPECT_LT(line.square, 1e-3F);
  }
}

TEST(GasPuff, ImageKeepsItsSumOnAnyGrid) {
  // A tilted Gaussian of at least 0.7 samples each way, at any place: the sum over the samples is
  // its integral.
  for (const float place : {0.0F, 0.13F, 0.31F, 0.5F}) {
    const glm::vec3 covariance(0.49F + 0.8F, 0.6F, 0.49F + 0.5F);
    double sum = 0.0;
    for (int y = -12; y <= 12; ++y) {
      for (int x = -12; x <= 12; ++x) {
        const glm::vec2 away(static_cast<float>(x) - place, static_cast<float>(y) + 2.0F * place);
        sum += gas_image_column(away, covariance, glm::vec2(1.0F));
      }
    }
    const double integral =
        2.0 * kPi * std::sqrt(covariance.x * covariance.z - double{covariance.y} * covariance.y);
    EXPECT_NEAR(sum / integral, 1.0, 2e-4) << place;
  }
}

}  // namespace
}  // namespace emit::physics
