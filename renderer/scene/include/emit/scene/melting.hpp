// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string_view>

#include "emit/scene/scene_desc.hpp"

namespace emit::scene {

/// Family of water, snow and ice in material libraries.
inline constexpr std::string_view kWaterFamily = "water, snow and ice";

/// Returns whether a material is snow or ice, which cannot be above 0 C: one of the family of water
/// that is no water, because it gives none to the air.
[[nodiscard]] inline bool is_snow_or_ice(const Material& material) noexcept {
  return material.family == kWaterFamily && moisture_of(material).dry() && !material.prescribed_k;
}

}  // namespace emit::scene
