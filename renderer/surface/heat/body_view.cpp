// SPDX-License-Identifier: Apache-2.0
#include "surface/heat/body_view.hpp"

#include <cstddef>

#include "emit/physics/check.hpp"

namespace emit::renderer {
namespace {

void add_to(SideView::Met& sum, const SideView::Met& part, float weight) noexcept {
  sum.frac += weight * part.frac;
  sum.longwave_w_m2 += weight * part.longwave_w_m2;
  sum.shortwave_w_m2 += weight * part.shortwave_w_m2;
}

}  // namespace

SideView BodyView::towards(const glm::vec3& normal_body) const noexcept {
  EMIT_DCHECK(known);
  SideView out;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float along = normal_body[static_cast<glm::length_t>(axis)];
    const SideView& side = sides[along >= 0.0F ? axis : axis + 3];
    const float weight = along * along;
    out.up_frac += weight * side.up_frac;
    add_to(out.still_up, side.still_up, weight);
    add_to(out.still_down, side.still_down, weight);
    add_to(out.moved_up, side.moved_up, weight);
    add_to(out.moved_down, side.moved_down, weight);
  }
  return out;
}

}  // namespace emit::renderer
