// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <vector>

#include "emit/scene/scene_desc.hpp"

namespace emit::config {

/// Combined coefficient of convection (13.3 at 2 m/s) and linearised radiation (about 5.7 at
/// 290 K) that the derived modes assume, W m-2 K-1.
inline constexpr double kSlabModesFilmWPerM2K = 19.0;

/// Relaxation modes of a layer whose back is held at the core temperature and whose front sees a
/// film coefficient, after a step of the equilibrium temperature (PHYSICS 4).
///
/// With Bi = film d / lambda and a = lambda / (rho cp), separation of variables gives
///   beta cot(beta) = -Bi,   tau = d^2 / (a beta^2),   w = 2 (1 + Bi) / (Bi + Bi^2 + beta^2),
/// w being the share of the surface's total rise that a mode carries; all shares sum to 1. The
/// `count` largest (and slowest) are returned, fastest first, with weights rescaled to sum to 1:
/// the model's step response has to end at equilibrium.
/// Preconditions: every field of `layer` and `film_w_m2_k` finite and > 0, count in 1..16.
[[nodiscard]] std::vector<scene::RelaxationMode> slab_modes(
    const scene::Layer& layer, double film_w_m2_k = kSlabModesFilmWPerM2K, int count = 2);

}  // namespace emit::config
