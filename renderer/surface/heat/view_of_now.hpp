// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "history/entity_stand.hpp"
#include "surface/heat/surface_samples.hpp"

namespace emit::renderer {

/// View of a sample of an entity as the entity stands at an instant. The shares and the weights of
/// the seen samples sum up to 1, as long as samples exchange radiation.
struct ViewOfNow {
  float sky_frac = 0.0F;
  float far_frac = 0.0F;
  float sphere_sky_frac = 0.0F;
  /// Factor on the weights of seen samples of the same entity, and of all others: as
  /// SurfaceSample::seen_scale.
  float own_scale = 0.0F;
  float others_scale = 0.0F;
};

/// Returns the share of the sky past the own hull of a sample for the zenith `up_body` (physics.md
/// eq. 26). RT-safe.
[[nodiscard]] float sky_past_hull(const SurfaceSample& sample, const glm::vec3& up_body) noexcept;

/// Returns the view of a sample of an entity at a stand. With moved_frac 0 it is the view of the
/// warm-up. With 1 the sky lies above the horizon past the own hull, the surroundings below it, and
/// no sample but those of the own hull is seen. Between them it is the mean. RT-safe.
[[nodiscard]] ViewOfNow view_of_now(const SurfaceSamples& all, const SurfaceSample& sample,
                                    const EntityStand& stand) noexcept;

}  // namespace emit::renderer
