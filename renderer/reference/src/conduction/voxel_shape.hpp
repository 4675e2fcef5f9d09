// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::reference {

/// What fills a cell of the feature grid.
enum class ShapeFill : std::uint8_t { open, solid, cavity };

/// A scene of axis-aligned faces as boxes: the planes of all faces cut space into a small grid, and
/// every cell of it is open air, inside a closed solid, or a cavity that the air does not reach.
struct VoxelShape {
  std::array<std::vector<double>, 3> planes_m;
  std::vector<ShapeFill> fill;          ///< at index(i, j, k), cells between the planes
  std::vector<std::uint32_t> material;  ///< of solid cells: scene material
  /// Ground: per column of cells i, j the scene material, or kNoGround; all at one height.
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

/// Errors as VoxelModel::build().
[[nodiscard]] physics::Result<VoxelShape> voxel_shape(const scene::ScenarioDesc& scenario,
                                                      const scene::SceneGeometry& geometry);

}  // namespace emit::reference
