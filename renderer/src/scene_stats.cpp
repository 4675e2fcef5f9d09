// SPDX-License-Identifier: Apache-2.0
#include "emit/renderer/renderer.hpp"

namespace emit::renderer {

std::vector<std::string> warm_up_warnings(const SceneStats& stats) {
  std::vector<std::string> out = stats.first_frame_warnings;
  if (stats.samples_full) {
    out.emplace_back(
        "thermal.max_samples stopped the refinement: shadows are coarser than tolerance_k asks");
  }
  if (stats.coarse_meshes) {
    out.emplace_back(
        "thermal.max_samples is too small for the meshes: outlines are up to two pixels off");
  }
  return out;
}

}  // namespace emit::renderer
