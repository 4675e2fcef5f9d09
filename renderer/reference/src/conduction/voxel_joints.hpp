// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "emit/scene/scene_desc.hpp"
#include "voxel_shape.hpp"

namespace emit::reference {

/// Rectangle of the feature grid where two bodies touch with a resistance between them.
struct VoxelJoint {
  std::size_t axis = 0;
  double plane_m = 0.0;
  double depth_m = 0.0;               ///< signed, from the plane into the body that holds the cells
  std::array<std::size_t, 3> body{};  ///< cell of the feature grid that holds the cells
  double resistance_m2k_w = 0.0;
};
/// Finds the rectangles at which bodies touch with a resistance. `materials` are those of the
/// scene.
[[nodiscard]] std::vector<VoxelJoint> find_joints(const scene::ScenarioDesc& scenario,
                                                  std::span<const scene::Material> materials,
                                                  const VoxelShape& shape);

}  // namespace emit::reference
