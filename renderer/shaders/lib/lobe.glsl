// SPDX-License-Identifier: Apache-2.0
#ifndef EMIT_LIB_LOBE
#define EMIT_LIB_LOBE

// Glossy surfaces: emission by angle, and a lobe that sees the sky, what stands below it and the sun (physics.md section
// 5). Twin of renderer/stages/lobe_model.cpp, which makes the tables.
// The including shader defines EMIT_LOBE_TABLE(index), a float of the table of lobes, and EMIT_LOBE_SKY(index), a vec4
// of the sky as lobes see it.
const int kLobeNodes = 32;
const int kLobeCurves = 6;
const int kLobeBlock = 2;                                   // numbers of a block before its bands
const int kLobeBand = 1 + kLobeNodes * kLobeCurves;         // numbers of a band
const int kLobeSkyElevations = 33;
const int kLobeSkyWidths = 9;
const float kLobeSkyScale = 0.03;
const float kLobeSkyNodesPerUnit = 16.0 / 4.19993000198038;  // asinh(1 / 0.03)
const float kLobeDiscRad = 0.00465304786;                    // radius of the sun's disc
const float kLobeLeastShut = 0.02;

// Curves of a lobe.
const int kLobeEmissivity = 0;
const int kLobeShare = 1;
const int kLobeForward = 2;
const int kLobeUpward = 3;
const int kLobeUnmasked = 4;
const int kLobeSunFacet = 5;

// A glossy surface of a pixel.
struct LobePixel {
  int block;          // place of the material's block; 0: the material is not glossy
  int sky;            // first node of the sky for its kind of facets
  vec2 view;          // place of the direction of view on the curves
  vec2 sun;           // place of the direction of the sun
  vec2 facet;         // place of the angle between facets that reflect the sun and the view
  vec3 normal;
  vec3 forward;       // along the surface, away from the viewer, as long as the sine of the view
  float sky_seen;     // share of the sky before the face that nothing hides
  float open_frac;    // share of the hemisphere that shows sky
  float sun_cosine;   // cosine of the sun's incidence times its visible share
  float glint_per_sr; // of facets that reflect everything, times the visible share of the sun
};

// Place of a cosine on a curve: x = node, y = position behind it, 0..1.
vec2 lobe_place(float cosine) {
  float place = float(kLobeNodes - 1) * sqrt(clamp(cosine, 0.0, 1.0));
  float node = min(floor(place), float(kLobeNodes - 2));
  return vec2(node, place - node);
}

// Value of a curve of a band at a place.
float lobe_curve(int block, uint band, int curve, vec2 place) {
  int first = block + kLobeBlock + int(band) * kLobeBand + 1 + curve * kLobeNodes + int(place.x);
  return mix(EMIT_LOBE_TABLE(first), EMIT_LOBE_TABLE(first + 1), place.y);
}

// Share of facets that both directions see, from that of each.
float lobe_unmasked_both(float from, float to) {
  return from > 0.0 && to > 0.0 ? 1.0 / (1.0 / from + 1.0 / to - 1.0) : 0.0;
}

// Light of the sun that facets reflect to the viewer, per irradiance and per reflectance of the facets, sr-1 (physics.md
// eq. 74). `across2` is the squared sine between the half-way direction and the normal.
float lobe_glint_per_sr(float slope2, bool gaussian, float view_cosine, float facet_cosine, float across2,
                        float open) {
  // Spread the facets by the sun's disc, and show no more than the disc itself.
  float disc2 = 0.25 * kLobeDiscRad * kLobeDiscRad;
  float wide2 = sqrt((slope2 + disc2) * (slope2 + disc2 / max(facet_cosine * facet_cosine, 1e-4)));
  float cos2 = max(1.0 - across2, 1e-6);
  float spread = wide2 * cos2 + across2;
  float density = gaussian ? exp(-across2 / (cos2 * wide2)) / (EMIT_PI * wide2 * cos2 * cos2)
                           : wide2 / (EMIT_PI * spread * spread);
  return min(density * open / (4.0 * view_cosine), 1.0 / (EMIT_PI * kLobeDiscRad * kLobeDiscRad));
}

// Finds what all bands share. `to_viewer` and `to_sun` are unit vectors.
LobePixel lobe_pixel(int block, vec3 normal, vec3 to_viewer, vec3 to_sun, float open_frac, float sun_cosine) {
  LobePixel p;
  p.block = block;
  bool gaussian = EMIT_LOBE_TABLE(block + 1) > 0.5;
  p.sky = gaussian ? 2 * kLobeSkyElevations * kLobeSkyWidths : 0;
  p.normal = normal;
  float view_cosine = clamp(dot(normal, to_viewer), 1e-3, 1.0);
  p.forward = normal * dot(normal, to_viewer) - to_viewer;
  p.view = lobe_place(view_cosine);
  p.open_frac = open_frac;
  p.sky_seen = min(open_frac / max(0.5 + 0.5 * normal.z, 1e-3), 1.0);
  p.sun_cosine = sun_cosine;
  // Find the facets that reflect the sun.
  float sun_up = dot(normal, to_sun);
  vec3 half_way = to_viewer + to_sun;
  half_way *= inversesqrt(max(dot(half_way, half_way), 1e-12));
  vec3 off = cross(normal, half_way);
  float facet_cosine = clamp(dot(half_way, to_viewer), 0.0, 1.0);
  p.sun = lobe_place(sun_up);
  p.facet = lobe_place(facet_cosine);
  float open = lobe_unmasked_both(lobe_curve(block, 0u, kLobeUnmasked, p.view),
                                  lobe_curve(block, 0u, kLobeUnmasked, p.sun));
  float glint = lobe_glint_per_sr(EMIT_LOBE_TABLE(block), gaussian, view_cosine, facet_cosine,
                                  dot(off, off), open);
  bool lit = sun_up > 1e-4 && dot(normal, half_way) > 0.0;
  p.glint_per_sr = lit ? glint * min(sun_cosine / max(sun_up, 1e-4), 1.0) : 0.0;
  return p;
}

// Sky as a lobe sees it: x = radiance of the band times the share of the lobe in the sky, y = that share. `sky` is the
// first node for the kind of facets.
vec2 lobe_sky(uint band, int sky, float sine, float length_frac) {
  float x = sine / kLobeSkyScale;
  float root = log(abs(x) + sqrt(x * x + 1.0)) * kLobeSkyNodesPerUnit;
  float along = clamp(16.0 + (x < 0.0 ? -root : root), 0.0, float(kLobeSkyElevations - 1));
  float across = clamp(8.0 * sqrt(sqrt(max(1.0 - length_frac, 0.0))), 0.0, float(kLobeSkyWidths - 1));
  float column = min(floor(along), float(kLobeSkyElevations - 2));
  float row = min(floor(across), float(kLobeSkyWidths - 2));
  int first = sky + int(row) * kLobeSkyElevations + int(column);
  int shares = kLobeSkyElevations * kLobeSkyWidths;
  vec2 near = mix(vec2(EMIT_LOBE_SKY(first)[band], EMIT_LOBE_SKY(shares + first).x),
                  vec2(EMIT_LOBE_SKY(first + 1)[band], EMIT_LOBE_SKY(shares + first + 1).x), along - column);
  first += kLobeSkyElevations;
  vec2 far = mix(vec2(EMIT_LOBE_SKY(first)[band], EMIT_LOBE_SKY(shares + first).x),
                 vec2(EMIT_LOBE_SKY(first + 1)[band], EMIT_LOBE_SKY(shares + first + 1).x), along - column);
  return mix(near, far, across - row);
}

// Band radiance that leaves a glossy surface, W m-2 sr-1: x = emission and reflection of all but the sun, y = reflected
// sunlight. `incoming` is the mean of what arrives from all but the sun, `sky` that of the sky before a face of that
// tilt.
vec2 lobe_leaving_w_m2_sr(uint band, LobePixel p, float black, float incoming, float sky, float surroundings,
                          float sun_w_m2) {
  float emissivity = lobe_curve(p.block, band, kLobeEmissivity, p.view);
  float share = lobe_curve(p.block, band, kLobeShare, p.view);
  float diffuse = 1.0 - emissivity - share;
  // Look up the sky around the mean direction of the lobe.
  vec3 mean = lobe_curve(p.block, band, kLobeForward, p.view) * p.forward +
              lobe_curve(p.block, band, kLobeUpward, p.view) * p.normal;
  float length_frac = max(length(mean), 1e-3);
  vec2 seen = lobe_sky(band, p.sky, mean.z / length_frac, length_frac);
  // No part of the lobe lies behind the face, so a level one sees nothing below the horizon.
  float low = min(1.0, (1.0 - p.normal.z) / (2.0 * (1.0 - length_frac) + 1e-6));
  seen *= p.sky_seen / max(seen.y + (1.0 - seen.y) * low, 1e-3);
  // The rest of the lobe sees what hides the sky from the face, and what lies below it.
  float rest = incoming - p.open_frac * sky - (1.0 - p.open_frac) * surroundings;
  float other = max(surroundings + rest / max(1.0 - p.open_frac, kLobeLeastShut), 0.0);
  float from_lobe = seen.x + (1.0 - seen.y) * other;
  // Reflect the sun.
  float mean_diffuse = max(EMIT_LOBE_TABLE(p.block + kLobeBlock + int(band) * kLobeBand), 1e-6);
  float to_sun = 1.0 - lobe_curve(p.block, band, kLobeEmissivity, p.sun) - lobe_curve(p.block, band, kLobeShare, p.sun);
  float sun_per_sr = diffuse * to_sun / (mean_diffuse * EMIT_PI) * p.sun_cosine +
                     lobe_curve(p.block, band, kLobeSunFacet, p.facet) * p.glint_per_sr;
  return vec2(emissivity * black + share * from_lobe + diffuse * incoming, sun_per_sr * sun_w_m2);
}

#endif
