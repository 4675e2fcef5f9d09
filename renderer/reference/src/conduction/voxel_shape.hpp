// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::reference {

/// Filling of a cell of the feature grid.
enum class ShapeFill : std::uint8_t { open, solid, cavity };

/// Scene of axis-aligned faces as boxes. The planes of all faces cut space into a small feature
/// grid. Every cell of it is open air, inside a closed solid, or a cavity that the open air does
/// not reach.
struct VoxelShape {
  std::array<std::vector<double>, 3> planes_m;
  std::vector<ShapeFill> fill;  ///< filling of the cells between the planes, at index(i, j, k)
  std::vector<std::uint32_t> material;  ///< scene material of solid cells
  /// Scene material of the ground per column of cells i, j, or kNoGround. All ground lies at one
  /// height.
  static constexpr std::uint32_t kNoGround = 0xffffffffU;
  std::vector<std::uint32_t> ground;
  bool has_ground = false;
  double ground_z_m = 0.0;

  [[nodiscard]] std::size_t count(std::size_t axis) const noexcept {
    return planes_m[axis].size() - 1;
  }
  [[nodiscard]] std::size_t index(std::size_t i, std::size_t j, std::size_t k) const noexcept {
    return i + count(0) * (j + count(1) * k);
  }
};

/// Builds the feature grid of a scene. Errors: those of VoxelModel::build().
[[nodiscard]] physics::Result<VoxelShape> voxel_shape(const scene::ScenarioDesc& scenario,
                                                      const scene::SceneGeometry& geometry);

}  // namespace emit::reference
