// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/gas/jet.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"

namespace emit::physics {
namespace {

/// Ricou and Spalding: the mass flow of a jet grows by 0.32 of its own per nozzle diameter. As a
/// speed across the edge of a jet with flat profiles that is 0.08 of its speed.
constexpr double kEntrainment = 0.08;
/// Share of the air's speed that mixes a jet whose own speed has gone: turbulence behind a body.
constexpr double kWake = 0.05;
/// Width of the share of exhaust by that of the speed in a jet (Fischer et al. 1979).
constexpr double kSpread = 1.2;

}  // namespace

void jet_nodes(const JetExit& exit, const JetAir& air, double last_frac,
               std::span<JetNode> out) noexcept {
  EMIT_CHECK(out.size() >= 2 && last_frac > 0.0 && last_frac < 1.0);
  // The density is that of an ideal gas, in units of the air's. Mass flow is in units of the
  // nozzle's, and what it carries of momentum and heat beyond the air's is constant.
  const double excess_m_s = exit.speed_m_s - air.along_m_s;
  const double excess_k = exit.kelvin - air.kelvin;
  const double exit_density = air.kelvin / exit.kelvin;
  const double exit_flow = exit_density * exit.speed_m_s * exit.radius_m * exit.radius_m;
  const auto section = [&](double flow) {
    JetNode node;
    const double share = 1.0 / flow;
    node.speed_m_s = air.along_m_s + excess_m_s * share;
    const double density = air.kelvin / (air.kelvin + excess_k * share);
    // Turn the flat profiles into Gaussian ones that carry the same: a jet of its own speed holds
    // more gas than the flat one, because its edge is slow.
    const double radius2_m2 = exit_flow * flow / (density * node.speed_m_s);
    const double own = std::clamp((node.speed_m_s - air.along_m_s) / node.speed_m_s, 0.0, 1.0);
    constexpr double kHeld = (1.0 + kSpread * kSpread) / (kSpread * kSpread);
    const double held = 1.0 + own * (kHeld * kSpread * kSpread / 2.0 - 1.0);
    node.exhaust_frac = std::min(1.0, share * held * 2.0 / (kSpread * kSpread));
    // The hot middle is thinner than the flat section, and the cold edge is denser.
    const double warmth = node.exhaust_frac * excess_k / air.kelvin;
    const double mean_density = std::abs(warmth) > 1e-6 ? std::log1p(warmth) / warmth : 1.0;
    const double width2_m2 =
        radius2_m2 * density * share * held / (node.exhaust_frac * mean_density);
    node.sigma_m = std::sqrt(0.5 * width2_m2);
    return node;
  };
  // The distance from the nozzle follows from the mass flow by quadrature, in equal ratios.
  const double ratio = std::pow(1.0 / last_frac, 1.0 / static_cast<double>(out.size() - 1));
  double flow = 1.0;
  out[0] = section(flow);
  for (std::size_t i = 1; i < out.size(); ++i) {
    constexpr int kSteps = 4;
    double way_m = 0.0;
    for (int k = 0; k < kSteps; ++k) {
      const double from = flow * std::pow(ratio, static_cast<double>(k) / kSteps);
      const double to = flow * std::pow(ratio, static_cast<double>(k + 1) / kSteps);
      const double middle = std::sqrt(from * to);
      const double speed_m_s = air.along_m_s + excess_m_s / middle;
      const double density = air.kelvin / (air.kelvin + excess_k / middle);
      const double radius_m = std::sqrt(exit_flow * middle / (density * speed_m_s));
      const double mixing_m_s =
          kEntrainment * (std::abs(excess_m_s) / middle + kWake * air.along_m_s);
      way_m += exit_flow * (to - from) / (2.0 * std::sqrt(density) * mixing_m_s * radius_m);
    }
    flow *= ratio;
    const double from_m = out[i - 1].from_nozzle_m;
    out[i] = section(flow);
    out[i].from_nozzle_m = from_m + way_m;
  }
}

double flame_height_m(double heat_release_w, double diameter_m) noexcept {
  return std::max(0.0, 0.235 * std::pow(heat_release_w * 1e-3, 0.4) - 1.02 * diameter_m);
}

}  // namespace emit::physics
