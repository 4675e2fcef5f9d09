// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <vector>

#include "emit/scene/scene_desc.hpp"

namespace emit::config {

/// Coefficient of convection (13.3 at 2 m/s) plus linearised radiation (about 5.7 at 290 K) that
/// the derived modes assume, W m-2 K-1.
inline constexpr double kSlabModesFilmWPerM2K = 19.0;

/// Relaxation modes of a layer after a step of the equilibrium temperature. The back of the layer
/// has the core temperature, the front has a film coefficient (physics.md section 4).
///
/// With Bi = film d / lambda and a = lambda / (rho cp), separation of variables gives
///   beta cot(beta) = -Bi,   tau = d^2 / (a beta^2),   w = 2 (1 + Bi) / (Bi + Bi^2 + beta^2),
/// where w is the share of the surface's total rise that a mode carries. The result is the `count`
/// slowest modes, fastest first. Their weights are rescaled to sum to 1, because the step response
/// of the model has to end at equilibrium.
/// @pre every field of `layer` and `film_w_m2_k` is finite and > 0; count is in 1..16
[[nodiscard]] std::vector<scene::RelaxationMode> slab_modes(
    const scene::Layer& layer, double film_w_m2_k = kSlabModesFilmWPerM2K, int count = 2);

}  // namespace emit::config
