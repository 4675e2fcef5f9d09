// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/planck.hpp"

/// Absorption of hot combustion gas, which is carbon dioxide and water vapour in air, by the
/// exponential wide-band model of Edwards (1976) as Modest prints it (Radiative Heat Transfer,
/// 2nd ed., table 10.3; physics.md eq. 51). Any thread.
namespace emit::physics {

/// Combustion products in a gas, as mole fractions.
struct GasMixture {
  double co2_frac = 0.0;
  double h2o_frac = 0.0;

  [[nodiscard]] bool operator==(const GasMixture&) const = default;
};

/// Homogeneous gas: what it is made of, how warm it is, and the pressure of the whole.
struct GasState {
  GasMixture mixture;
  double kelvin = 0.0;  ///< 200..3500
  double pressure_pa = 101'325.0;
};

/// Returns the absorption coefficient of a gas at a wavenumber, smooth over its lines, and the
/// width of the lines by their distance, for all bands of one molecule.
struct GasLines {
  double absorption_per_m = 0.0;
  double overlap = 0.0;  ///< Edwards' beta Pe, weighted by absorption; 0 without absorption
};
/// Smooth absorption of each of the two molecules at a wavenumber in cm-1. Setup only.
[[nodiscard]] std::array<GasLines, 2> gas_lines(const GasState& gas, double wavenumber_per_cm);
/// Returns the transmittance of a path through a gas at a wavenumber, averaged over lines, 0..1.
/// Setup only.
[[nodiscard]] double gas_transmittance(const GasState& gas, double wavenumber_per_cm,
                                       double path_m);
/// Returns the share of a blackbody's radiation in a band that a path through a gas emits, 0..1.
/// The blackbody is as warm as `source_k`. Setup only.
[[nodiscard]] double gas_absorptance(const GasState& gas, const Band& band, double source_k,
                                     double path_m);

inline constexpr std::size_t kGasTerms = 4;

/// Gas in one band for the picture: a sum of four exponential terms in the optical depth.
/// The shape of the sum belongs to one reference gas. Other temperatures and mixtures keep the
/// shape, and their mean absorption is right where the gas is thin.
class GasBand {
 public:
  static constexpr std::size_t kNodes = 33;
  static constexpr double kColdestK = 200.0;
  static constexpr double kHottestK = 3400.0;

  /// Makes the terms of a band for gas like `reference`. Setup only: some milliseconds.
  /// Errors: invalid_argument if the band does not pass validate().
  [[nodiscard]] static Result<GasBand> build(const Band& band, const GasState& reference);

  /// Returns the mean absorption coefficient of pure gas at one atmosphere of partial pressure, by
  /// molecule (carbon dioxide, water), m-1 atm-1, weighted with a blackbody of the gas's own
  /// temperature. Temperatures are clamped to kColdestK..kHottestK. RT-safe.
  [[nodiscard]] std::array<double, 2> mean_per_m_atm(double kelvin) const noexcept;

  /// Shares of the terms in the band. They add up to 1.
  [[nodiscard]] const std::array<double, kGasTerms>& share_frac() const noexcept { return share_; }
  /// Optical depths of the terms by the mean one: sum share_frac depth = 1.
  [[nodiscard]] const std::array<double, kGasTerms>& depth() const noexcept { return depth_; }
  /// Largest error of the sum in the absorptance of the reference gas, from thin to thick, as a
  /// share of the absorptance.
  [[nodiscard]] double fit_error_frac() const noexcept { return fit_error_; }

 private:
  std::array<double, kGasTerms> share_{1.0, 0.0, 0.0, 0.0};
  std::array<double, kGasTerms> depth_{};
  double fit_error_ = 0.0;
  std::vector<std::array<double, 2>> mean_;  ///< by temperature
};

}  // namespace emit::physics
