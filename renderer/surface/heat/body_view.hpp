// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <glm/ext/vector_float3.hpp>

namespace emit::renderer {

/// Surfaces that stand in view of one side of a body, as cosine-weighted shares of its hemisphere,
/// and what they send. `up` is above the horizon, `down` below it.
struct SideView {
  struct Met {
    float frac = 0.0F;
    float longwave_w_m2 = 0.0F;   ///< sum of exitance times share
    float shortwave_w_m2 = 0.0F;  ///< likewise
  };
  float up_frac = 0.0F;  ///< share of the hemisphere above the horizon
  Met still_up;          ///< met surfaces that stand as they did at the warm-up
  Met still_down;
  Met moved_up;  ///< met surfaces of other entities that have moved since
  Met moved_down;
};

/// View of an entity from where it is, by the six directions of its body axes: first the positive
/// ones, then the negative ones.
struct BodyView {
  bool known = false;  ///< false: nothing stands near that the views of the warm-up do not have
  std::array<SideView, 6> sides{};

  /// Returns the view of a face with this unit normal in body axes. The three axes count with the
  /// square of the normal. @pre known
  [[nodiscard]] SideView towards(const glm::vec3& normal_body) const noexcept;
};

}  // namespace emit::renderer
