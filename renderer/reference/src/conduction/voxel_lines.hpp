// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "emit/reference/voxel_model.hpp"
#include "voxel_joints.hpp"
#include "voxel_shape.hpp"

namespace emit::reference {

/// Thickness of the row of held cells under the ground, m. The value does not matter.
inline constexpr double kHeldRowM = 0.01;

/// Returns the grid lines of one axis. Lines lie on every plane across which the filling changes
/// and on every boundary of a layer. They are dense at faces and in places that shadows pass.
/// `materials` are those of the scene.
[[nodiscard]] std::vector<double> voxel_lines(std::size_t axis, const VoxelShape& shape,
                                              std::span<const scene::Material> materials,
                                              std::span<const VoxelJoint> joints,
                                              const VoxelOptions& options);

}  // namespace emit::reference
