// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::reference {

/// Largest distance of a face from the plane that it lies in, m.
inline constexpr double kPlaneM = 2e-5;

/// Returns the cell between ascending lines that contains x, clamped to the first and last cell.
[[nodiscard]] inline std::size_t cell_of(const std::vector<double>& lines, double x) {
  const auto after = std::upper_bound(lines.begin(), lines.end(), x);
  return static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(
      after - lines.begin() - 1, 0, static_cast<std::ptrdiff_t>(lines.size()) - 2));
}

/// Returns the thickness of all layers of a material, m.
[[nodiscard]] inline double layers_m(const scene::Material& material) {
  double sum = 0.0;
  for (const scene::Layer& layer : material.layers) sum += layer.thickness_m;
  return sum;
}

/// Filling of a cell of the feature grid.
enum class ShapeFill : std::uint8_t { open, solid, cavity };

/// Scene of axis-aligned faces as boxes. The planes of all faces cut space into a small feature
/// grid. Every cell of it is open air, inside a closed solid, or a cavity that the open air does
/// not reach. A sheet becomes a solid of its thickness that lies behind its front.
struct VoxelShape {
  std::array<std::vector<double>, 3> planes_m;
  std::vector<ShapeFill> fill;  ///< filling of the cells between the planes, at index(i, j, k)
  std::vector<std::uint32_t> material;  ///< scene material of solid cells
  std::vector<std::uint32_t> object;    ///< object of solid cells
  /// Scene material of what covers the rectangles across an axis, at face_index(), towards smaller
  /// and towards greater coordinates; kNoGround where nothing faces that way.
  std::array<std::vector<std::array<std::uint32_t, 2>>, 3> cover;
  double thickest_sheet_m = 0.0;
  /// Scene material of the ground per column of cells i, j, or kNoGround. All ground lies at one
  /// height.
  static constexpr std::uint32_t kNoGround = 0xffffffffU;
  std::vector<std::uint32_t> ground;
  std::vector<std::uint32_t> ground_object;  ///< object of the ground, likewise
  bool has_ground = false;
  double ground_z_m = 0.0;

  [[nodiscard]] std::size_t count(std::size_t axis) const noexcept {
    return planes_m[axis].size() - 1;
  }
  [[nodiscard]] std::size_t index(std::size_t i, std::size_t j, std::size_t k) const noexcept {
    return i + count(0) * (j + count(1) * k);
  }
  /// Visits every cell with its place on the three axes and its index.
  template <class Visit>
  void for_cells(Visit visit) const {
    for (std::size_t k = 0; k < count(2); ++k) {
      for (std::size_t j = 0; j < count(1); ++j) {
        for (std::size_t i = 0; i < count(0); ++i) visit(i, j, k, index(i, j, k));
      }
    }
  }
  /// Returns the index of the rectangle across an axis on the lower side of a cell.
  [[nodiscard]] std::size_t face_index(std::size_t axis,
                                       const std::array<std::size_t, 3>& cell) const noexcept {
    std::array<std::size_t, 3> n{count(0), count(1), count(2)};
    ++n[axis];
    return cell[0] + n[0] * (cell[1] + n[1] * cell[2]);
  }
};

/// Builds the feature grid of a scene. Errors: those of VoxelModel::build().
[[nodiscard]] physics::Result<VoxelShape> voxel_shape(const scene::ScenarioDesc& scenario,
                                                      const scene::SceneGeometry& geometry);

}  // namespace emit::reference
