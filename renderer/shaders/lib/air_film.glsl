// SPDX-License-Identifier: Apache-2.0
#ifndef EMIT_LIB_AIR_FILM
#define EMIT_LIB_AIR_FILM

// Film coefficient of a face in the wind (physics.md eq. 31 to 34 and 97). Twin of emit/physics/air_film.hpp.

// Film coefficient in W/m2/K of a face of unit normal `n` (world axes, z up), which is `excess_k` warmer than the air.
// `skin` is the roughness factor of its material, and what leaves add to the forced and to the natural part.
float film_w_m2_k(FilmParams film, vec3 n, vec3 skin, float excess_k) {
  // Compute the natural part. A warm face that looks up, or a cold one that looks down, stirs the air.
  float size_k = abs(excess_k);
  float third = pow(size_k, 1.0 / 3.0);
  float quarter = sqrt(sqrt(size_k));
  float root = film.vertical_root + film.vertical_rise * sqrt(third);
  float vertical = root * root;
  float level_frac = min(abs(n.z), 1.0);
  bool unstable = n.z * excess_k > 0.0;
  float level = unstable ? max(film.unstable_quarter * quarter, film.unstable_third * third)
                         : film.stable_quarter * quarter;
  float way = unstable ? 6.283 * level_frac / (7.283 - level_frac) : 2.382 * level_frac / (1.382 + level_frac);
  float natural = vertical + (level - vertical) * way;
  // Compute the forced part by the share of the windward side.
  float facing_frac = clamp(1.0 + 5.0 * dot(n, film.upwind), 0.0, 1.0);
  float any_frac = 0.5 + 0.5 / (1.0 + 10.0 * sqrt(max(0.0, 1.0 - n.z * n.z)));
  float windward_frac = mix(any_frac, facing_frac, film.directed_frac);
  float forced = mix(film.leeward_w_m2_k, film.windward_w_m2_k, windward_frac);
  // Leaves have parts of their own.
  if (skin.y > 0.0) {
    natural = skin.z * film.leaf_quarter * quarter;
    forced = skin.y * film.leaf_forced;
  }
  // Join both parts with what the user gave.
  float rough = 1.0 + film.rough_frac * (skin.x - 1.0);
  float model = natural + rough * (sqrt(natural * natural + forced * forced) - natural);
  return film.stated_w_m2_k + film.model_frac * model;
}

#endif
