// SPDX-License-Identifier: Apache-2.0
#include "emit/config/slab_modes.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"

namespace emit::config {

namespace {

/// Root number `index` (from 0) of beta cos(beta) + Bi sin(beta) = 0; the only one in
/// ((index + 1/2) pi, (index + 1) pi), since beta cot(beta) falls from 0 to -infinity there.
double slab_root(double biot, int index) {
  double lo = (index + 0.5) * physics::kPi;
  double hi = (index + 1.0) * physics::kPi;
  const double sign_lo = index % 2 == 0 ? 1.0 : -1.0;  // sign of the function at lo, Bi sin(lo)
  for (int i = 0; i < 100; ++i) {
    const double mid = 0.5 * (lo + hi);
    const double value = mid * std::cos(mid) + biot * std::sin(mid);
    (value * sign_lo > 0.0 ? lo : hi) = mid;
  }
  return 0.5 * (lo + hi);
}

}  // namespace

std::vector<scene::RelaxationMode> slab_modes(const scene::Layer& layer, double film_w_m2_k,
                                              int count) {
  for (const double value : {layer.thickness_m, layer.conductivity_w_m_k, layer.density_kg_m3,
                             layer.specific_heat_j_kg_k, film_w_m2_k}) {
    EMIT_CHECK(std::isfinite(value));
    EMIT_CHECK_OP(value, >, 0.0);
  }
  EMIT_CHECK_OP(count, >=, 1);
  EMIT_CHECK_OP(count, <=, 16);
  const double diffusivity_m2_s =
      layer.conductivity_w_m_k / (layer.density_kg_m3 * layer.specific_heat_j_kg_k);
  const double biot = film_w_m2_k * layer.thickness_m / layer.conductivity_w_m_k;
  std::vector<scene::RelaxationMode> modes;
  double sum = 0.0;
  for (int i = 0; i < count; ++i) {
    const double beta = slab_root(biot, i);
    scene::RelaxationMode mode;
    mode.tau_s = layer.thickness_m * layer.thickness_m / (diffusivity_m2_s * beta * beta);
    mode.weight_frac = 2.0 * (1.0 + biot) / (biot + biot * biot + beta * beta);
    sum += mode.weight_frac;
    modes.push_back(mode);
  }
  for (scene::RelaxationMode& mode : modes) {
    mode.weight_frac /= sum;
  }
  std::reverse(modes.begin(), modes.end());
  return modes;
}

}  // namespace emit::config
