// SPDX-License-Identifier: Apache-2.0
#ifndef EMIT_LIB_FOSTER
#define EMIT_LIB_FOSTER

// Flux-driven thermal network of up to six modes (physics.md eq. 16 to 18). Twin of emit/physics/foster.hpp, which
// computes the gains in double on the CPU. A state is the temperature of a mode above the base, in K. Modes come by
// fours: EMIT_FOSTER_GROUPS is 1 where no material of the scene has more than four, else 2.
#include "lib/equilibrium.glsl"
#include "lib/evaporation.glsl"

// A number for each mode.
struct FosterModes {
  vec4 group[EMIT_FOSTER_GROUPS];
};

// Sum over all modes.
float foster_sum(FosterModes x) {
  float sum = (x.group[0].x + x.group[0].y) + (x.group[0].z + x.group[0].w);
  for (int g = 1; g < EMIT_FOSTER_GROUPS; ++g) {
    sum += (x.group[g].x + x.group[g].y) + (x.group[g].z + x.group[g].w);
  }
  return sum;
}

// Inputs that drive a surface at an instant.
struct FosterDrive {
  vec3 dry;    // absorbed flux in W/m2, film coefficient in W/m2/K, air temperature minus the reference in K
  vec3 moist;  // k in W/m2/Pa where water leaves and where dew forms, vapour pressure in Pa; all 0 if dry
};

// Drive between `a` (f = 0) and `b` (f = 1), linear in f.
FosterDrive drive_between(FosterDrive a, FosterDrive b, float f) {
  return FosterDrive(mix(a.dry, b.dry, f), mix(a.moist, b.moist, f));
}

// Constants of one surface.
struct FosterSurface {
  FosterModes resistance_m2k_w;
  float emission_w_m2_k4;  // emissivity * sigma
  float base_offset_k;     // base temperature minus reference_k
  float reference_k;
};

// Surface temperature minus the reference, in K, for the states `x`.
float foster_offset_k(FosterModes x, FosterSurface s) { return s.base_offset_k + foster_sum(x); }

// Net flux into the surface in W/m2 at a temperature that is given as an offset from the reference.
float foster_flux_w_m2(float offset_k, FosterDrive drive, FosterSurface s) {
  float t = s.reference_k + offset_k;
  float t2 = t * t;
  return drive.dry.x + drive.dry.y * (drive.dry.z - offset_k) - s.emission_w_m2_k4 * t2 * t2 -
         latent_flux(t, drive.moist).x;
}

// True for a moist surface whose flux at the start, held over the whole step, would carry it past its balance by more
// than it is off. Half of such a flux rings from step to step.
bool foster_rings(FosterModes x, float q_begin, FosterDrive begin, FosterModes start_frac, FosterModes end_frac,
                  FosterSurface s) {
  if (!(begin.moist.y > 0.0)) return false;
  FosterModes there;
  for (int g = 0; g < EMIT_FOSTER_GROUPS; ++g) {
    there.group[g] = x.group[g] + (s.resistance_m2k_w.group[g] * q_begin - x.group[g]) *
                                      (start_frac.group[g] + end_frac.group[g]);
  }
  float q_there = foster_flux_w_m2(foster_offset_k(there, s), begin, s);
  return (q_there + q_begin) * q_begin < 0.0;
}

// States after one step whose drive goes from `begin` to `end`. The flux at its start is that of `begin`. Sets
// `clamped` where an input lies outside its range.
FosterModes foster_step(FosterModes x, FosterDrive begin, FosterDrive end, FosterModes start_frac,
                        FosterModes end_frac, FosterSurface s, inout bool clamped) {
  // Let the flux at the end count for the whole step where that at the start would ring.
  float begin_offset_k = foster_offset_k(x, s);
  float q_begin = foster_flux_w_m2(begin_offset_k, begin, s);
  if (foster_rings(x, q_begin, begin, start_frac, end_frac, s)) {
    for (int g = 0; g < EMIT_FOSTER_GROUPS; ++g) {
      end_frac.group[g] += start_frac.group[g];
      start_frac.group[g] = vec4(0.0);
    }
  }
  // Advance the states with the flux at the start; the flux at the end is still missing.
  FosterModes partial;
  FosterModes gain;
  for (int g = 0; g < EMIT_FOSTER_GROUPS; ++g) {
    vec4 own = x.group[g];
    partial.group[g] =
        own + ((s.resistance_m2k_w.group[g] * q_begin - own) * start_frac.group[g] - own * end_frac.group[g]);
    gain.group[g] = s.resistance_m2k_w.group[g] * end_frac.group[g];
  }
  float p_k = foster_offset_k(partial, s);
  float r_m2k_w = foster_sum(gain);
  if (!(r_m2k_w > 0.0)) return x;  // no time passed
  // Take the latent heat along its tangent at the start, so that the balance stays a quartic.
  float begin_k = s.reference_k + begin_offset_k;
  vec2 latent = latent_flux(begin_k, end.moist);
  // Solve for the temperature at the end (physics.md eq. 18).
  float conductance = 1.0 / r_m2k_w;
  bool guarded = false;
  float t = equilibrium_k(s.emission_w_m2_k4, end.dry.y + conductance + latent.y,
                          end.dry.x + end.dry.y * (s.reference_k + end.dry.z) +
                              conductance * (s.reference_k + p_k) + (latent.y * begin_k - latent.x),
                          guarded);
  clamped = clamped || guarded;
  // Polish it by one Newton step on offsets. A temperature in kelvin resolves only 3e-5 K, which a short step would
  // turn into a wrong flux. The step also leads from the tangent of the latent heat to its curve.
  float offset_k = t - s.reference_k;
  float slope = 4.0 * s.emission_w_m2_k4 * t * t * t + end.dry.y + latent_flux(t, end.moist).y;
  if (!guarded) {
    offset_k += (foster_flux_w_m2(offset_k, end, s) - (offset_k - p_k) * conductance) / (slope + conductance);
  }
  // Add the flux at the end, from the side of the equation that loses less to rounding.
  float q_end = slope * r_m2k_w > 1.0 ? (offset_k - p_k) * conductance : foster_flux_w_m2(offset_k, end, s);
  for (int g = 0; g < EMIT_FOSTER_GROUPS; ++g) partial.group[g] += gain.group[g] * q_end;
  return partial;
}

#endif
