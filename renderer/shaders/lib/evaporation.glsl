// SPDX-License-Identifier: Apache-2.0
#ifndef EMIT_LIB_EVAPORATION
#define EMIT_LIB_EVAPORATION

// Latent heat of surfaces that give water to the air (physics.md eq. 47 to 50). Twin of emit/physics/evaporation.hpp
// and saturation.hpp.

// Latent heat that leaves a surface of `t` kelvin in W/m2, and its slope in W/m2/K. `moist` holds k in W/m2/Pa where
// water leaves and where dew forms, and the vapour pressure in Pa; a dry surface has zeros.
vec2 latent_flux(float t, vec3 moist) {
  if (!(moist.y > 0.0)) return vec2(0.0);
  float held_k = clamp(t, 180.0, 400.0);
  float celsius = held_k - 273.15;
  bool frozen = celsius < 0.0;
  float a = frozen ? 21.875 : 17.27;
  float b = frozen ? 265.5 : 237.3;
  float above = celsius + b;
  float pressure_pa = 610.8 * exp(a * celsius / above);
  float slope_pa_k = pressure_pa * a * b / (above * above);
  float excess_pa = pressure_pa + slope_pa_k * (t - held_k) - moist.z;
  float k_w_m2_pa = excess_pa > 0.0 ? moist.x : moist.y;
  return vec2(k_w_m2_pa * excess_pa, k_w_m2_pa * slope_pa_k);
}

// Exchange of water under a film and a short-wave irradiance, as latent_flux() takes it. `water` holds the wetness
// and the resistances in sunlight and without it in s/m, `wet_frac` is the share that rain has wetted. Without both
// the surface is dry, and has the vapour of the air alone.
vec3 moist_drive(vec3 water, float wet_frac, MoistAirParams air, float film_w_m2_k, float shortwave_w_m2) {
  if (!(water.x > 0.0 || wet_frac > 0.0)) return vec3(0.0, 0.0, air.vapour_pa);
  float resistance_s_m = water.y;
  float light_frac = clamp(shortwave_w_m2 / air.stomata_w_m2, 0.0, 1.0);
  if (resistance_s_m > 0.0 && light_frac < 1.0) {
    float night_m_s = 1.0 / max(water.z, resistance_s_m);
    resistance_s_m = 1.0 / mix(night_m_s, 1.0 / resistance_s_m, light_frac);
  }
  float dew = film_w_m2_k / air.psychrometric_pa_k;
  float share = water.x / (1.0 + film_w_m2_k * resistance_s_m / air.heat_j_m3_k);
  return vec3(mix(share, 1.0, wet_frac) * dew, dew, air.vapour_pa);
}

#endif
