// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cmath>
#include <glm/ext/vector_float3.hpp>

#include "emit/physics/check.hpp"

namespace emit::renderer {

/// Two unit vectors that form a right-handed frame (u, v, n) with a normal n.
struct Tangents {
  glm::vec3 u;
  glm::vec3 v;
};

/// Returns tangents of a normal; see Duff et al. (2017), "Building an orthonormal basis,
/// revisited".
/// @pre n has unit length
[[nodiscard]] inline Tangents tangents_of(const glm::vec3& n) noexcept {
  EMIT_DCHECK(std::abs(n.x * n.x + n.y * n.y + n.z * n.z - 1.0F) < 1e-3F);
  const float sign = std::copysign(1.0F, n.z);
  const float a = -1.0F / (sign + n.z);
  const float b = n.x * n.y * a;
  return {{1.0F + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}};
}

}  // namespace emit::renderer
