// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/foster.hpp"

#include <algorithm>

namespace emit::physics {

std::complex<double> stack_impedance_m2k_w(std::span<const StackLayer> layers,
                                           double angular_rad_s) noexcept {
  std::complex<double> z = 0.0;  // the base is isothermal
  for (auto layer = layers.rbegin(); layer != layers.rend(); ++layer) {
    // Pass from below through every layer, physics.md eq. 19.
    const std::complex<double> g = std::sqrt(std::complex<double>(
        0.0, angular_rad_s * layer->volumetric_heat_j_m3_k / layer->conductivity_w_m_k));
    const std::complex<double> gd = g * layer->thickness_m;
    // Treat a thin layer as a plain resistance: its own impedance is infinite at frequency 0.
    if (std::abs(gd) < 1e-6) {
      z += layer->thickness_m / layer->conductivity_w_m_k;
      continue;
    }
    const std::complex<double> own = 1.0 / (layer->conductivity_w_m_k * g);
    const std::complex<double> t = std::tanh(gd);
    z = own * (z + own * t) / (own + z * t);
  }
  return z;
}

std::complex<double> network_impedance_m2k_w(const FosterNetwork& network,
                                             double angular_rad_s) noexcept {
  std::complex<double> z = 0.0;
  for (std::size_t i = 0; i < network.count; ++i) {
    z += network.modes[i].resistance_m2k_w /
         std::complex<double>(1.0, angular_rad_s * network.modes[i].tau_s);
  }
  return z;
}

FosterGains<double> foster_gains(double dt_s, const FosterNetwork& network) noexcept {
  FosterGains<double> gains;
  for (std::size_t i = 0; i < network.count; ++i) {
    const RelaxationGains<double> g = relaxation_gains(dt_s, network.modes[i].tau_s);
    gains.start_frac[i] = g.start_frac;
    gains.end_frac[i] = g.end_frac;
  }
  return gains;
}

FosterGains<double> foster_doubled(const FosterGains<double>& gains) noexcept {
  FosterGains<double> out;
  for (std::size_t i = 0; i < kMaxFosterModes; ++i) {
    // 1 - E^2 = t (2 - t) and phi(2z) = phi(z) (1 + E) / 2 with t = 1 - E.
    const double total = gains.start_frac[i] + gains.end_frac[i];
    const double end = gains.end_frac[i] + 0.5 * total * (1.0 - gains.end_frac[i]);
    out.end_frac[i] = end;
    out.start_frac[i] = total * (2.0 - total) - end;
  }
  return out;
}

FosterSurface<double> foster_surface(const FosterNetwork& network, double emissivity_frac,
                                     double base_k, double reference_k) noexcept {
  FosterSurface<double> surface;
  surface.emission_w_m2_k4 = emissivity_frac * kStefanBoltzmannWPerM2K4;
  for (std::size_t i = 0; i < network.count; ++i) {
    surface.resistance_m2k_w[i] = network.modes[i].resistance_m2k_w;
  }
  surface.base_offset_k = base_k - reference_k;
  surface.reference_k = reference_k;
  return surface;
}

FosterLadder foster_ladder(double dt_s, const FosterNetwork& network) noexcept {
  FosterLadder ladder;
  // Compute the finest level and double it up to the whole interval.
  ladder.level[kMaxFosterLevel] =
      foster_gains(dt_s / static_cast<double>(1 << kMaxFosterLevel), network);
  for (int i = kMaxFosterLevel; i > 0; --i) {
    const auto level = static_cast<std::size_t>(i);
    ladder.level[level - 1] = foster_doubled(ladder.level[level]);
  }
  return ladder;
}

FosterAdvance foster_advance(FosterState<double>& x, const FosterDrive<double>& begin,
                             const FosterDrive<double>& end, const FosterLadder& ladder,
                             const FosterSurface<double>& surface, double tolerance_k) noexcept {
  FosterAdvance result;
  // Start with one step, then halve the steps until the result stops moving.
  const FosterState<double> start = x;
  result.clamped = foster_step(x, begin, end, ladder.level[0], surface);
  for (int level = 1; level <= kMaxFosterLevel; ++level) {
    const FosterState<double> coarse = x;
    const FosterGains<double>& gains = ladder.level[static_cast<std::size_t>(level)];
    const int steps = 1 << level;
    x = start;
    FosterDrive<double> from = begin;
    for (int i = 1; i <= steps; ++i) {
      const FosterDrive<double> to =
          i == steps ? end : lerp(begin, end, static_cast<double>(i) / steps);
      result.clamped = foster_step(x, from, to, gains, surface) || result.clamped;
      from = to;
    }
    // Compare with the coarser result. Step doubling of a second-order scheme leaves a third of the
    // change as error.
    double change_k = std::abs(foster_offset_k(x, surface) - foster_offset_k(coarse, surface));
    for (std::size_t i = 0; i < kMaxFosterModes; ++i) {
      change_k = std::max(change_k, std::abs(x[i] - coarse[i]));
    }
    result.level = level;
    result.error_k = change_k / 3.0;
    if (!(change_k > tolerance_k)) break;
  }
  return result;
}

}  // namespace emit::physics
