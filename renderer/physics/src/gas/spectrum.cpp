// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/gas/spectrum.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "emit/physics/constants.hpp"
#include "emit/physics/nnls.hpp"

namespace emit::physics {
namespace {

constexpr double kSecondRadiationCmK = 1.438777;  ///< h c / k
constexpr double kEdwardsK = 100.0;               ///< temperature of the table
constexpr double kAtmospherePa = 101'325.0;
constexpr double kGasConstant = 8.314463;
constexpr std::array<double, 2> kMolarMassG{44.010, 18.015};
/// Widths of a band beyond which its wing is left out.
constexpr double kWing = 30.0;
/// Widths over which a band is level before it falls off. A plain exponential band absorbs ln tau +
/// 0.577 widths where it is strong; the correlation that the table's numbers belong to has ln tau +
/// 1, and this is the level part that gives it: kLevel - ln(1 + kLevel) = 1 - 0.577.
constexpr double kLevel = 1.2216;

/// One band of a molecule (Modest, table 10.3).
struct WideBand {
  std::size_t molecule;       ///< 0: carbon dioxide, 1: water
  double middle_per_cm;       ///< centre, or the upper end of a band with a head
  bool head;                  ///< the band reaches from its head to lower wavenumbers
  std::array<int, 3> change;  ///< of the vibrational quantum numbers
  double pressure_exponent;
  double intensity;  ///< alpha_0, cm-1 / (g m-2)
  double overlap;    ///< beta_0
  double width_per_cm;
};
constexpr std::array<WideBand, 13> kBands{{
    {0, 667.0, false, {0, 1, 0}, 0.7, 19.0, 0.06157, 12.7},
    {0, 960.0, false, {-1, 0, 1}, 0.8, 2.47e-9, 0.04017, 13.4},
    {0, 1060.0, false, {0, -2, 1}, 0.8, 2.48e-9, 0.11888, 10.1},
    {0, 2410.0, true, {0, 0, 1}, 0.8, 110.0, 0.24723, 11.2},
    {0, 3660.0, false, {1, 0, 1}, 0.65, 4.0, 0.13341, 23.5},
    {0, 5200.0, false, {2, 0, 1}, 0.65, 0.066, 0.39305, 34.5},
    {1, 140.0, false, {0, 0, 0}, 1.0, 44205.0, 0.14311, 69.3},
    {1, 1600.0, false, {0, 1, 0}, 1.0, 41.2, 0.09427, 56.4},
    {1, 3760.0, false, {0, 2, 0}, 1.0, 0.2, 0.13219, 60.0},
    {1, 3760.0, false, {1, 0, 0}, 1.0, 2.3, 0.13219, 60.0},
    {1, 3760.0, false, {0, 0, 1}, 1.0, 23.4, 0.13219, 60.0},
    {1, 5350.0, false, {0, 1, 1}, 1.0, 3.0, 0.08169, 43.1},
    {1, 7250.0, false, {1, 0, 1}, 1.0, 2.5, 0.11628, 32.0},
}};
constexpr std::array<std::array<double, 3>, 2> kVibrationPerCm{
    {{1351.0, 667.0, 2396.0}, {3652.0, 1595.0, 3756.0}}};
constexpr std::array<std::array<int, 3>, 2> kDegeneracy{{{1, 2, 1}, {1, 1, 1}}};

double factorial(int n) {
  return std::tgamma(n + 1.0);
}

/// Sums over the levels of all vibrations of a molecule at a temperature.
struct Levels {
  double occupied = 1.0;  ///< all levels
  double moved = 1.0;     ///< levels with the strength of the change
  double root = 1.0;      ///< square roots of the latter
};
Levels levels_of(const WideBand& band, double kelvin) {
  Levels out;
  for (std::size_t k = 0; k < 3; ++k) {
    const double u = kSecondRadiationCmK * kVibrationPerCm[band.molecule][k] / kelvin;
    const int g = kDegeneracy[band.molecule][k];
    const int steps = std::abs(band.change[k]);
    const int lowest = band.change[k] < 0 ? steps : 0;
    double occupied = 0.0;
    double moved = 0.0;
    double root = 0.0;
    for (int v = 0; v < 60; ++v) {
      const double share = std::exp(-u * v);
      occupied += factorial(v + g - 1) / (factorial(g - 1) * factorial(v)) * share;
      if (v < lowest) continue;
      const double strength =
          factorial(v + g + steps - 1) / (factorial(g - 1) * factorial(v)) * share;
      moved += strength;
      root += std::sqrt(strength);
    }
    out.occupied *= occupied;
    out.moved *= moved;
    out.root *= root;
  }
  return out;
}

/// A wide band at the state of a gas.
struct BandNow {
  double intensity = 0.0;  ///< cm-1 / (g m-2)
  double width_per_cm = 1.0;
  double overlap = 0.0;  ///< beta Pe
};
BandNow band_now(const WideBand& band, const GasState& gas) {
  const bool rotation = band.change == std::array<int, 3>{0, 0, 0};
  const double frac = band.molecule == 0 ? gas.mixture.co2_frac : gas.mixture.h2o_frac;
  const double broadening =
      band.molecule == 0 ? 1.3 : 8.6 * std::sqrt(kEdwardsK / gas.kelvin) + 0.5;
  const double pressure = std::pow(
      gas.pressure_pa / kAtmospherePa * (1.0 + (broadening - 1.0) * frac), band.pressure_exponent);
  BandNow out;
  out.width_per_cm = band.width_per_cm * std::sqrt(gas.kelvin / kEdwardsK);
  if (rotation) {
    out.intensity = band.intensity * std::exp(-9.0 * std::sqrt(kEdwardsK / gas.kelvin));
    out.overlap = band.overlap * std::sqrt(kEdwardsK / gas.kelvin) * pressure;
    return out;
  }
  // Scale the intensity by the populations of the levels, and the overlap by those that add lines.
  const Levels now = levels_of(band, gas.kelvin);
  const Levels table = levels_of(band, kEdwardsK);
  double u_change = 0.0;
  double u_table = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double u = kSecondRadiationCmK * kVibrationPerCm[band.molecule][k] * band.change[k];
    u_change += u / gas.kelvin;
    u_table += u / kEdwardsK;
  }
  const double psi = now.moved / now.occupied * -std::expm1(-u_change);
  const double psi_table = table.moved / table.occupied * -std::expm1(-u_table);
  out.intensity = band.intensity * psi / psi_table;
  const double phi = now.root * now.root / now.moved;
  const double phi_table = table.root * table.root / table.moved;
  out.overlap = band.overlap * std::sqrt(kEdwardsK / gas.kelvin) * phi / phi_table * pressure;
  return out;
}

/// All bands of a gas, ready for many wavenumbers.
struct GasNow {
  std::array<BandNow, kBands.size()> bands;
  std::array<double, 2> density_g_m3{};  ///< of the molecules

  explicit GasNow(const GasState& gas) {
    for (std::size_t i = 0; i < kBands.size(); ++i) bands[i] = band_now(kBands[i], gas);
    const std::array<double, 2> frac{gas.mixture.co2_frac, gas.mixture.h2o_frac};
    for (std::size_t m = 0; m < 2; ++m) {
      density_g_m3[m] = frac[m] * gas.pressure_pa / (kGasConstant * gas.kelvin) * kMolarMassG[m];
    }
  }
  [[nodiscard]] std::array<GasLines, 2> at(double wavenumber_per_cm) const {
    std::array<GasLines, 2> out;
    for (std::size_t i = 0; i < kBands.size(); ++i) {
      const WideBand& band = kBands[i];
      const double away = band.middle_per_cm - wavenumber_per_cm;
      if (band.head && away < 0.0) continue;
      const double widths = (band.head ? 1.0 : 2.0) * std::abs(away) / bands[i].width_per_cm;
      if (widths > kWing) continue;
      const double per_m = bands[i].intensity / bands[i].width_per_cm / (1.0 + kLevel) *
                           std::exp(-std::max(0.0, widths - kLevel)) * density_g_m3[band.molecule];
      GasLines& lines = out[band.molecule];
      lines.absorption_per_m += per_m;
      lines.overlap += per_m * bands[i].overlap;
    }
    for (GasLines& lines : out) {
      if (lines.absorption_per_m > 0.0) lines.overlap /= lines.absorption_per_m;
    }
    return out;
  }
};

/// Transmittance of lines at random places (Goody) over a path.
double through_lines(const GasLines& lines, double path_m) {
  const double depth = lines.absorption_per_m * path_m;
  return depth > 0.0 ? std::exp(-depth / std::sqrt(1.0 + depth / lines.overlap)) : 1.0;
}

/// Points over a band, uniform in wavenumber, with response and blackbody as weights that add up
/// to 1.
struct Point {
  double wavenumber_per_cm;
  double weight;
};
std::vector<Point> points_over(const Band& band, double source_k) {
  constexpr double kStepPerCm = 5.0;
  const double low = 1e4 / band.hi_um;
  const double high = 1e4 / band.lo_um;
  const auto count =
      static_cast<std::size_t>(std::clamp(std::ceil((high - low) / kStepPerCm), 16.0, 4000.0));
  std::vector<Point> out;
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const double per_cm =
        low + (high - low) * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    const double um = 1e4 / per_cm;
    // A step of wavenumber is a step of wavelength times its square.
    const double weight = response_frac(band, um) * um * um *
                          spectral_radiance(Micrometres(um), Kelvin(source_k)).value();
    out.push_back({per_cm, weight});
    sum += weight;
  }
  if (!(sum > 0.0)) return {};
  for (Point& point : out) point.weight /= sum;
  return out;
}

double absorptance(const GasNow& gas, const std::vector<Point>& points, double path_m) {
  double sum = 0.0;
  for (const Point& point : points) {
    const auto lines = gas.at(point.wavenumber_per_cm);
    sum += point.weight * (1.0 - through_lines(lines[0], path_m) * through_lines(lines[1], path_m));
  }
  return sum;
}

}  // namespace

std::array<GasLines, 2> gas_lines(const GasState& gas, double wavenumber_per_cm) {
  return GasNow(gas).at(wavenumber_per_cm);
}

double gas_transmittance(const GasState& gas, double wavenumber_per_cm, double path_m) {
  // Callers walk along a spectrum: keep the bands of the latest gas.
  thread_local GasState latest;
  thread_local std::optional<GasNow> bands;
  const auto same = [&] {
    return bands && latest.mixture == gas.mixture && latest.kelvin == gas.kelvin &&
           latest.pressure_pa == gas.pressure_pa;
  };
  if (!same()) {
    bands.emplace(gas);
    latest = gas;
  }
  const auto lines = bands->at(wavenumber_per_cm);
  return through_lines(lines[0], path_m) * through_lines(lines[1], path_m);
}

double gas_absorptance(const GasState& gas, const Band& band, double source_k, double path_m) {
  return absorptance(GasNow(gas), points_over(band, source_k), path_m);
}

Result<GasBand> GasBand::build(const Band& band, const GasState& reference) {
  if (auto valid = validate(band); !valid) return tl::unexpected(std::move(valid.error()));
  GasBand out;
  // Tabulate the mean absorption of each molecule over temperature. One atmosphere of the pure gas
  // is the unit; in the thin limit pressure does not matter otherwise.
  for (std::size_t i = 0; i < kNodes; ++i) {
    const double kelvin = kColdestK + (kHottestK - kColdestK) * static_cast<double>(i) /
                                          static_cast<double>(kNodes - 1);
    std::array<double, 2> mean{};
    const GasNow gas({.mixture = {1.0, 1.0}, .kelvin = kelvin, .pressure_pa = kAtmospherePa});
    for (const Point& point : points_over(band, kelvin)) {
      const auto lines = gas.at(point.wavenumber_per_cm);
      for (std::size_t m = 0; m < 2; ++m) mean[m] += point.weight * lines[m].absorption_per_m;
    }
    out.mean_.push_back(mean);
  }
  // Sample the absorptance of the reference gas from thin to thick.
  const GasNow gas(reference);
  const std::vector<Point> points = points_over(band, reference.kelvin);
  double mean_per_m = 0.0;
  for (const Point& point : points) {
    const auto lines = gas.at(point.wavenumber_per_cm);
    mean_per_m += point.weight * (lines[0].absorption_per_m + lines[1].absorption_per_m);
  }
  if (!(mean_per_m > 0.0)) {
    // The band is clear: nothing absorbs, whatever the terms are.
    out.depth_ = {1.0, 1.0, 1.0, 1.0};
    return out;
  }
  constexpr std::size_t kSamples = 41;
  std::array<double, kSamples> depth{};
  std::array<double, kSamples> target{};
  for (std::size_t i = 0; i < kSamples; ++i) {
    depth[i] = std::pow(10.0, -3.0 + 5.0 * static_cast<double>(i) / (kSamples - 1));
    target[i] = absorptance(gas, points, depth[i] / mean_per_m);
  }
  // Try three depths in a geometric row, with the shares that fit best: the shares add up to at
  // most 1, the mean depth is 1, and errors count as shares of the absorptance.
  constexpr std::size_t kRows = kSamples + 1;
  double best = std::numeric_limits<double>::infinity();
  for (double middle = 0.3; middle < 60.0; middle *= 1.25) {
    for (double ratio = 1.6; ratio < 40.0; ratio *= 1.25) {
      const std::array<double, 3> term{middle / ratio, middle, middle * ratio};
      std::array<double, kRows * 3> matrix{};
      std::array<double, kRows> rhs{};
      for (std::size_t i = 0; i < kSamples; ++i) {
        for (std::size_t t = 0; t < 3; ++t) {
          matrix[3 * i + t] = -std::expm1(-term[t] * depth[i]) / target[i];
        }
        rhs[i] = 1.0;
      }
      constexpr double kHeld = 1e3;
      for (std::size_t t = 0; t < 3; ++t) matrix[3 * kSamples + t] = kHeld * term[t];
      rhs[kSamples] = kHeld;
      const std::vector<double> share = solve_nnls(matrix, rhs, 3);
      const double covered = share[0] + share[1] + share[2];
      if (covered > 1.0) continue;
      double worst = 0.0;
      for (std::size_t i = 0; i < kSamples; ++i) {
        double sum = 0.0;
        for (std::size_t t = 0; t < 3; ++t) sum += matrix[3 * i + t] * share[t];
        worst = std::max(worst, std::abs(sum - 1.0));
      }
      if (worst >= best) continue;
      best = worst;
      const double mean = share[0] * term[0] + share[1] * term[1] + share[2] * term[2];
      out.share_ = {1.0 - covered, share[0], share[1], share[2]};
      out.depth_ = {0.0, term[0] / mean, term[1] / mean, term[2] / mean};
    }
  }
  if (!std::isfinite(best)) {
    // Every mixture of three terms covers more than the band, which only grey gas does.
    out.share_ = {0.0, 1.0, 0.0, 0.0};
    out.depth_ = {0.0, 1.0, 0.0, 0.0};
    best = 0.0;
    for (std::size_t i = 0; i < kSamples; ++i) {
      best = std::max(best, std::abs(-std::expm1(-depth[i]) / target[i] - 1.0));
    }
  }
  out.fit_error_ = best;
  return out;
}

std::array<double, 2> GasBand::mean_per_m_atm(double kelvin) const noexcept {
  const double place = std::clamp((kelvin - kColdestK) / (kHottestK - kColdestK), 0.0, 1.0) *
                       static_cast<double>(kNodes - 1);
  const auto low = std::min(static_cast<std::size_t>(place), kNodes - 2);
  const double frac = place - static_cast<double>(low);
  std::array<double, 2> out{};
  for (std::size_t m = 0; m < 2; ++m) {
    out[m] = mean_[low][m] + frac * (mean_[low + 1][m] - mean_[low][m]);
  }
  return out;
}

}  // namespace emit::physics
