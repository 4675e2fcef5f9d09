// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/voxel_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "voxel_shape.hpp"

namespace emit::reference {

physics::Result<void> VoxelModel::fits(const scene::ScenarioDesc& scenario,
                                       const scene::SceneGeometry& geometry) {
  const auto shape = voxel_shape(scenario, geometry);
  if (!shape) return tl::unexpected(shape.error());
  return {};
}

FaceCondition VoxelModel::condition(const SolidFace& face) const {
  const CellKind& kind = kinds_[face.material];
  const scene::Material& material = materials_[this->face(face).material];
  // Ground exposes only its upper face, inside the scene.
  if (kind.ground && !(face.axis == 2 && face.sign > 0 && face.outside_cell != kOutsideGrid)) {
    return {FaceKind::adiabatic, 0.0, 0.0};
  }
  // The wall of a cavity is held at the base temperature.
  if (!kind.ground && face.outside_cell != kOutsideGrid && cavity_cell_[face.outside_cell] != 0) {
    return {FaceKind::fixed, 0.0, material.base_k};
  }
  return {FaceKind::exposed, material.emissivity_frac, 0.0};
}

std::uint32_t VoxelModel::cover_of(const SolidFace& face) const {
  const CellKind& kind = kinds_[face.material];
  if (kind.ground || materials_[kind.material].sheet) return kind.material;
  // Find the rectangle of the feature grid that the face is a part of.
  std::array<std::size_t, 3> at{};
  const glm::dvec3 centre = face.centre_m();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::vector<double>& planes = shape_->planes_m[axis];
    const double x = centre[static_cast<glm::dvec3::length_type>(axis)];
    if (axis != face.axis) {
      at[axis] = cell_of(planes, x);
      continue;
    }
    const auto plane = std::lower_bound(planes.begin(), planes.end(), x - kPlaneM);
    if (plane == planes.end() || *plane > x + kPlaneM) return kind.material;
    at[axis] = static_cast<std::size_t>(plane - planes.begin());
  }
  const std::uint32_t seen =
      shape_->cover[face.axis][shape_->face_index(face.axis, at)][face.sign > 0 ? 1 : 0];
  return seen == VoxelShape::kNoGround ? kind.material : seen;
}

double VoxelModel::thickest_sheet_m() const noexcept {
  return shape_->thickest_sheet_m;
}

VoxelFace VoxelModel::face(const SolidFace& face) const {
  return {cover_of(face),
          face.outside_cell != kOutsideGrid && cavity_cell_[face.outside_cell] != 0};
}

double VoxelModel::steady_k(const glm::dvec3& point_m, double initial_k) const {
  const VoxelShape& shape = *shape_;
  // Find the cell of the feature grid.
  std::array<std::size_t, 3> at{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    at[axis] = cell_of(shape.planes_m[axis], point_m[static_cast<glm::dvec3::length_type>(axis)]);
  }
  double depth = std::numeric_limits<double>::infinity();
  std::uint32_t index = VoxelShape::kNoGround;
  if (shape.has_ground && point_m.z <= shape.ground_z_m) {
    depth = shape.ground_z_m - point_m.z;
    index = shape.ground[at[0] + shape.count(0) * at[1]];
  }
  if (index == VoxelShape::kNoGround) {
    // Find the nearest open air by boxes. Everything beyond the rim is open, except under the
    // ground.
    const auto away = [](double x, double low, double high) {
      return std::max({0.0, low - x, x - high});
    };
    depth = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < shape.count(2); ++k) {
      for (std::size_t j = 0; j < shape.count(1); ++j) {
        for (std::size_t i = 0; i < shape.count(0); ++i) {
          const std::size_t cell = shape.index(i, j, k);
          const auto& p = shape.planes_m;
          const double d = std::max({away(point_m.x, p[0][i], p[0][i + 1]),
                                     away(point_m.y, p[1][j], p[1][j + 1]),
                                     away(point_m.z, p[2][k], p[2][k + 1])});
          if (shape.fill[cell] == ShapeFill::open) {
            depth = std::min(depth, d);
          } else if (shape.fill[cell] == ShapeFill::solid && d <= 0.0) {
            index = shape.material[cell];
          }
        }
      }
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double x = point_m[static_cast<glm::dvec3::length_type>(axis)];
      depth = std::min(depth, shape.planes_m[axis].back() - x);
      if (axis != 2 || !shape.has_ground) depth = std::min(depth, x - shape.planes_m[axis].front());
    }
  }
  if (index == VoxelShape::kNoGround) return initial_k;
  const scene::Material& material = materials_[index];
  if (material.sheet) return material.initial_k.value_or(initial_k);
  // Divide the steady drop of temperature by the resistance above the point.
  double whole = 0.0;
  double above = 0.0;
  double left = std::min(std::max(depth, 0.0), layers_m(material));
  for (const scene::Layer& layer : material.layers) {
    const double part = std::min(left, layer.thickness_m);
    above += part / layer.conductivity_w_m_k;
    left -= part;
    whole += layer.thickness_m / layer.conductivity_w_m_k;
  }
  const double surface_k = material.initial_k.value_or(initial_k);
  return surface_k + (material.base_k - surface_k) * above / whole;
}

}  // namespace emit::reference
