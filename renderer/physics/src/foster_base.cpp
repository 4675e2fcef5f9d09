// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <vector>

#include "emit/physics/foster.hpp"

namespace emit::physics {
namespace {

/// Number of frequencies over which the shares are fitted.
constexpr std::size_t kShareFrequencies = 40;
/// Damping of the fit, relative to the largest entry of its matrix: modes with equal time constants
/// share evenly.
constexpr double kShareDamping = 1e-9;
/// Depth of a layer in damping depths, below which nothing of its base arrives.
constexpr double kDeepInDampings = 300.0;

using Complex = std::complex<double>;

/// Solves a symmetric, positive definite system of up to kMaxFosterModes - 1 unknowns in place.
void solve_shares(std::array<std::array<double, kMaxFosterModes>, kMaxFosterModes>& a,
                  FosterState<double>& b, std::size_t count) {
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t i = k + 1; i < count; ++i) {
      const double factor = a[i][k] / a[k][k];
      for (std::size_t j = k; j < count; ++j) a[i][j] -= factor * a[k][j];
      b[i] -= factor * b[k];
    }
  }
  for (std::size_t k = count; k-- > 0;) {
    for (std::size_t j = k + 1; j < count; ++j) b[k] -= a[k][j] * b[j];
    b[k] /= a[k][k];
  }
}

}  // namespace

Complex stack_transfer(std::span<const StackLayer> layers, double angular_rad_s) noexcept {
  Complex transfer = 1.0;
  Complex admittance = 0.0;  // of what lies above a layer; no heat leaves the surface
  for (const StackLayer& layer : layers) {
    const Complex g = std::sqrt(
        Complex(0.0, angular_rad_s * layer.volumetric_heat_j_m3_k / layer.conductivity_w_m_k));
    const Complex gd = g * layer.thickness_m;
    if (gd.real() > kDeepInDampings) return 0.0;
    if (std::abs(gd) < 1e-6) {
      // Treat a thin layer as a plain resistance.
      const double r_m2k_w = layer.thickness_m / layer.conductivity_w_m_k;
      transfer /= 1.0 + admittance * r_m2k_w;
      admittance /= 1.0 + admittance * r_m2k_w;
      continue;
    }
    const Complex own = 1.0 / (layer.conductivity_w_m_k * g);
    transfer /= std::cosh(gd) + own * admittance * std::sinh(gd);
    const Complex t = std::tanh(gd);
    admittance = (admittance + t / own) / (1.0 + own * admittance * t);
  }
  return transfer;
}

FosterState<double> base_shares(std::span<const StackLayer> layers, const FosterNetwork& network,
                                const NetworkOptions& options) noexcept {
  FosterState<double> shares{};
  if (network.count == 0) return shares;
  // Eliminate the share of the last mode, since all shares add up to 1, and fit the others.
  const std::size_t last = network.count - 1;
  std::array<std::array<double, kMaxFosterModes>, kMaxFosterModes> matrix{};
  for (std::size_t f = 0; f < kShareFrequencies; ++f) {
    const double way = static_cast<double>(f) / (kShareFrequencies - 1);
    const double period_s = options.longest_period_s *
                            std::pow(options.shortest_period_s / options.longest_period_s, way);
    const double angular_rad_s = 2.0 * kPi / period_s;
    std::array<Complex, kMaxFosterModes> mode;
    for (std::size_t i = 0; i < network.count; ++i) {
      mode[i] = 1.0 / Complex(1.0, angular_rad_s * network.modes[i].tau_s);
    }
    const Complex left = stack_transfer(layers, angular_rad_s) - mode[last];
    for (std::size_t i = 0; i < last; ++i) {
      const Complex own = std::conj(mode[i] - mode[last]);
      shares[i] += (own * left).real();
      for (std::size_t j = 0; j < last; ++j) {
        matrix[i][j] += (own * (mode[j] - mode[last])).real();
      }
    }
  }
  double largest = 0.0;
  for (std::size_t i = 0; i < last; ++i) largest = std::max(largest, matrix[i][i]);
  for (std::size_t i = 0; i < last; ++i) matrix[i][i] += kShareDamping * std::max(largest, 1e-300);
  solve_shares(matrix, shares, last);
  shares[last] = 1.0;
  for (std::size_t i = 0; i < last; ++i) shares[last] -= shares[i];
  return shares;
}

}  // namespace emit::physics
