// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>

#include "emit/physics/constants.hpp"
#include "emit/physics/equilibrium.hpp"

/// Absorbed flux and energy balance of a surface, physics.md eq. 1-4. The functions are templates
/// on float and double; shaders/lib/balance.glsl is the float32 twin. Any thread. RT-safe.
namespace emit::physics {

/// Inputs that a surface receives, W/m2 unless named otherwise.
template <class Real>
struct SurfaceFluxes {
  Real direct_w_m2 = 0;   ///< S_d: direct sun on the tilted surface, max(0, cos) included
  Real diffuse_w_m2 = 0;  ///< S_i: 2 E_dif,h (so that f_i = 0.5 absorbs E_dif,h)
  Real environment_w_m2 =
      0;                   ///< R_e: absorbed from the surroundings at f_i = 0, emissivity included
  Real longwave_w_m2 = 0;  ///< R_LW: see longwave_input_w_m2()
  Real cloud_frac = 0;     ///< beta: share of the direct sun taken away, 0..1
  Real sun_frac = 0;       ///< f_d: visible share of the sun's disc, 0..1
  Real sky_frac = 0;       ///< f_i: full-sphere factor, 0.5 on open flat ground, up to 1
};

/// Returns the absorbed flux of physics.md eq. 1, W/m2: E_abs = a_s [S_d f_d (1-beta) + S_i f_i] +
/// (1-f_i) R_e + eps f_i R_LW. `solar_absorptance_frac` is a_s = 1 - albedo. The result may be
/// negative for f_i > 0.5 and a hot environment.
template <class Real>
[[nodiscard]] constexpr Real absorbed_flux_w_m2(const SurfaceFluxes<Real>& in,
                                                Real solar_absorptance_frac,
                                                Real emissivity_frac) noexcept {
  return solar_absorptance_frac * (in.direct_w_m2 * in.sun_frac * (Real(1) - in.cloud_frac) +
                                   in.diffuse_w_m2 * in.sky_frac) +
         (Real(1) - in.sky_frac) * in.environment_w_m2 +
         emissivity_frac * in.sky_frac * in.longwave_w_m2;
}

/// Returns S_d, the direct irradiance on a face, W/m2. `cos_incidence` is negative for a face that
/// looks away from the sun; S_d is then 0.
template <class Real>
[[nodiscard]] constexpr Real direct_on_face_w_m2(Real direct_normal_w_m2,
                                                 Real cos_incidence) noexcept {
  return direct_normal_w_m2 * std::max(Real(0), cos_incidence);
}

/// Returns S_i of physics.md eq. 3 from the diffuse horizontal irradiance, W/m2. Flat ground (f_i =
/// 0.5) then absorbs exactly that irradiance.
template <class Real>
[[nodiscard]] constexpr Real diffuse_input_w_m2(Real diffuse_horizontal_w_m2) noexcept {
  return Real(2) * diffuse_horizontal_w_m2;
}

/// Returns R_e = eps sigma T_env^4 of physics.md eq. 3, W/m2.
template <class Real>
[[nodiscard]] constexpr Real environment_input_w_m2(Real emissivity_frac,
                                                    Real environment_k) noexcept {
  const Real t2 = environment_k * environment_k;
  return emissivity_frac * Real(kStefanBoltzmannWPerM2K4) * t2 * t2;
}

/// Returns R_LW = 2 L_down - sigma T_env^4 of physics.md eq. 3, that is 2 L_down - R_e / eps, W/m2.
/// With it absorbed_flux_w_m2() gives T_a = T_0 in an isothermal enclosure for every f_i, and flat
/// ground absorbs eps L_down.
template <class Real>
[[nodiscard]] constexpr Real longwave_input_w_m2(Real longwave_down_w_m2,
                                                 Real environment_k) noexcept {
  return Real(2) * longwave_down_w_m2 - environment_input_w_m2(Real(1), environment_k);
}

/// Coefficients of conduction to the core, convection and emission of one material.
template <class Real>
struct SurfaceExchange {
  Real emissivity_frac = 1;
  Real core_conductance_w_m2_k = 0;  ///< lambda / d
  Real core_k = 0;
  Real film_w_m2_k = 0;  ///< h_c; 0 leaves convection out, as in the published model
  Real air_k = 0;
};

/// Returns the coefficients of physics.md eq. 4, the quartic whose positive root is the equilibrium
/// temperature.
template <class Real>
[[nodiscard]] constexpr SurfaceBalance<Real> surface_balance(
    Real absorbed_w_m2, const SurfaceExchange<Real>& x) noexcept {
  return {x.emissivity_frac * Real(kStefanBoltzmannWPerM2K4),
          x.core_conductance_w_m2_k + x.film_w_m2_k,
          absorbed_w_m2 + x.core_conductance_w_m2_k * x.core_k + x.film_w_m2_k * x.air_k};
}

/// Returns T_a of physics.md eq. 2, the temperature in K at which emission alone balances
/// `absorbed_w_m2`. The result is NaN if `absorbed_w_m2` is negative, and not finite if
/// `emissivity_frac` is 0.
template <class Real>
[[nodiscard]] Real radiative_temperature_k(Real absorbed_w_m2, Real emissivity_frac) noexcept {
  return std::sqrt(std::sqrt(absorbed_w_m2 / (emissivity_frac * Real(kStefanBoltzmannWPerM2K4))));
}

}  // namespace emit::physics
