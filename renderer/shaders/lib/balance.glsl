// SPDX-License-Identifier: Apache-2.0
#ifndef EMIT_LIB_BALANCE
#define EMIT_LIB_BALANCE

// Heat balance of a surface. Twin of emit/physics/surface_balance.hpp. Fluxes are in W/m2, fractions in 0..1.

// Absorbed flux (physics.md eq. 1). `direct` contains the factor max(0, cos). `diffuse` is twice the diffuse horizontal
// irradiance. `environment` is absorbed already. `longwave` is a result of longwave_input_w_m2().
float absorbed_flux_w_m2(float direct_w_m2, float diffuse_w_m2, float environment_w_m2,
                         float longwave_w_m2, float cloud_frac, float sun_frac, float sky_frac,
                         float solar_absorptance_frac, float emissivity_frac) {
  return solar_absorptance_frac * (direct_w_m2 * sun_frac * (1.0 - cloud_frac) +
                                   diffuse_w_m2 * sky_frac) +
         (1.0 - sky_frac) * environment_w_m2 + emissivity_frac * sky_frac * longwave_w_m2;
}

// Long-wave input of the surroundings, R_e = eps sigma T_env^4.
float environment_input_w_m2(float emissivity_frac, float environment_k) {
  float t2 = environment_k * environment_k;
  return emissivity_frac * EMIT_STEFAN_BOLTZMANN_W_M2_K4 * t2 * t2;
}

// Long-wave input of the sky, R_LW = 2 L_down - sigma T_env^4.
float longwave_input_w_m2(float longwave_down_w_m2, float environment_k) {
  return 2.0 * longwave_down_w_m2 - environment_input_w_m2(1.0, environment_k);
}

// Coefficients (emission, conductance, source) of the quartic that equilibrium_k() solves.
vec3 surface_balance(float absorbed_w_m2, float emissivity_frac, float core_conductance_w_m2_k,
                     float core_k, float film_w_m2_k, float air_k) {
  return vec3(emissivity_frac * EMIT_STEFAN_BOLTZMANN_W_M2_K4,
              core_conductance_w_m2_k + film_w_m2_k,
              absorbed_w_m2 + core_conductance_w_m2_k * core_k + film_w_m2_k * air_k);
}

// Temperature in K at which emission alone balances the absorbed flux (physics.md eq. 2). NaN for a negative flux.
float radiative_temperature_k(float absorbed_w_m2, float emissivity_frac) {
  return sqrt(sqrt(absorbed_w_m2 / (emissivity_frac * EMIT_STEFAN_BOLTZMANN_W_M2_K4)));
}

#endif
