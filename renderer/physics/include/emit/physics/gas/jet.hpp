// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>

/// Round jets of hot gas: an exhaust in still or moving air, and the flame of a fire
/// (physics.md eq. 52 and 53). Any thread. RT-safe.
namespace emit::physics {

/// Gas at a nozzle whose pressure is that of the air.
struct JetExit {
  double radius_m = 0.0;   ///< > 0
  double speed_m_s = 0.0;  ///< against the nozzle, > 0
  double kelvin = 0.0;     ///< static temperature, > 0
};
/// Air around a jet.
struct JetAir {
  double kelvin = 0.0;
  double along_m_s = 0.0;  ///< speed of the air along the jet, against the nozzle; >= 0
};

/// Cross-section of a jet: Gaussian around its axis.
struct JetNode {
  double from_nozzle_m = 0.0;
  double sigma_m = 0.0;       ///< standard deviation of the share of exhaust gas
  double exhaust_frac = 0.0;  ///< share of exhaust gas on the axis, 0..1
  double speed_m_s = 0.0;     ///< mean over the section, against the nozzle
};

/// Writes the cross-sections of a jet from the nozzle to where the share of exhaust gas has fallen
/// to about `last_frac`, at shares of equal ratio. Entrainment is that of Ricou and Spalding
/// (1961); a twentieth of the air's speed adds to it, so that a jet as fast as the air mixes too.
/// @pre out.size() >= 2, 0 < last_frac < 1
void jet_nodes(const JetExit& exit, const JetAir& air, double last_frac,
               std::span<JetNode> out) noexcept;

/// Temperature of gas with a share of exhaust: the heat of both mixes at one specific heat.
[[nodiscard]] inline double jet_k(const JetExit& exit, const JetAir& air,
                                  double exhaust_frac) noexcept {
  return air.kelvin + exhaust_frac * (exit.kelvin - air.kelvin);
}

/// Mean height of the flame of a pool fire, m, by Heskestad (1983): 0.235 Q^2/5 - 1.02 D with the
/// heat release in kW. Not below 0.
[[nodiscard]] double flame_height_m(double heat_release_w, double diameter_m) noexcept;

}  // namespace emit::physics
