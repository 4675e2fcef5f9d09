// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <vector>

namespace emit::tool {

/// Says what a preview leaves out.
inline constexpr const char* kPreviewText =
    "preview: leaves out conduction along the surface and exchange of radiation between faces; "
    "temperatures aim at 2 K instead of thermal.tolerance_k, and shadows are coarse\n";

/// Puts the settings of a preview before the overrides of the user, which so count more. A preview
/// costs a few seconds for a scene of 50'000 triangles.
inline void set_preview(std::vector<std::string>& set) {
  const std::vector<std::string> preview{"thermal.method=\"cached\"", "thermal.max_samples=320000",
                                         "thermal.tolerance_k=2",     "thermal.first_step_s=120",
                                         "thermal.lateral=false",     "thermal.exchange=false",
                                         "thermal.shadow_map_px=512", "thermal.max_cascades=1"};
  set.insert(set.begin(), preview.begin(), preview.end());
}

}  // namespace emit::tool
