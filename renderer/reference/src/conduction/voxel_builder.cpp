// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>

#include "emit/reference/solid_grid.hpp"
#include "emit/reference/voxel_model.hpp"
#include "voxel_joints.hpp"
#include "voxel_lines.hpp"
#include "voxel_shape.hpp"

namespace emit::reference {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Builds the grid of a scene step by step.
class VoxelBuilder {
 public:
  VoxelBuilder(VoxelShape shape, const scene::ScenarioDesc& scenario,
               const scene::SceneGeometry& geometry, const VoxelOptions& options)
      : shape_(std::move(shape)), scenario_(scenario), options_(options) {
    model_.materials_ = geometry.materials;
  }

  Result<VoxelModel> build() {
    if (auto good = check_materials(); !good) return tl::unexpected(std::move(good.error()));
    find_hollow();
    joints_ = find_joints(scenario_, model_.materials_, shape_);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      model_.grid_.lines_m[axis] = voxel_lines(axis, shape_, model_.materials_, joints_, options_);
    }
    SolidGrid& grid = model_.grid_;
    // Refuse a grid with too many nodes before it takes memory.
    double nodes = 1.0;
    for (const auto& axis_lines : grid.lines_m) nodes *= static_cast<double>(axis_lines.size());
    if (nodes > static_cast<double>(options_.max_nodes)) {
      return make_error(ErrorCode::unsupported,
                        fmt::format("three-dimensional solution: {:.3g} grid nodes, more than {}",
                                    nodes, options_.max_nodes));
    }
    grid.cells.assign(grid.count(0) * grid.count(1) * grid.count(2), kVoidCell);
    model_.cavity_cell_.assign(grid.cells.size(), 0);
    fill_ground();
    fill_solids();
    fill_joints();
    model_.shape_ = std::make_shared<const VoxelShape>(std::move(shape_));
    return std::move(model_);
  }

 private:
  /// Checks that all solids and all ground have layers.
  Result<void> check_materials() const {
    const auto check = [&](std::uint32_t index) -> Result<void> {
      const scene::Material& material = model_.materials_[index];
      if (material.layers.empty()) {
        return make_error(ErrorCode::config,
                          fmt::format("material '{}' has no layers", material.name));
      }
      return {};
    };
    Result<void> result;
    shape_.for_cells([&](std::size_t, std::size_t, std::size_t, std::size_t cell) {
      if (result && shape_.fill[cell] == ShapeFill::solid) result = check(shape_.material[cell]);
    });
    for (const std::uint32_t material : shape_.ground) {
      if (result && material != VoxelShape::kNoGround) result = check(material);
    }
    return result;
  }

  /// Finds the materials of solids that touch a cavity, whose last layer extends to the cavity, and
  /// those of sheets, which have no core.
  void find_hollow() {
    hollow_.assign(model_.materials_.size(), 0);
    for (std::size_t m = 0; m < hollow_.size(); ++m) hollow_[m] = model_.materials_[m].sheet;
    shape_.for_cells([&](std::size_t i, std::size_t j, std::size_t k, std::size_t cell) {
      if (shape_.fill[cell] != ShapeFill::cavity) return;
      const std::array<std::size_t, 3> at{i, j, k};
      // Look at all six neighbours of a cavity cell.
      for (std::size_t axis = 0; axis < 3; ++axis) {
        for (const int step : {-1, 1}) {
          if (step < 0 ? at[axis] == 0 : at[axis] + 1 == shape_.count(axis)) continue;
          std::array<std::size_t, 3> next = at;
          next[axis] += step < 0 ? std::size_t(-1) : 1;
          const std::size_t other = shape_.index(next[0], next[1], next[2]);
          if (shape_.fill[other] != ShapeFill::solid) continue;
          hollow_[shape_.material[other]] = 1;
          model_.cavity_k_ = model_.materials_[shape_.material[other]].base_k;
        }
      }
    });
  }

  /// Returns the grid material for a layer of a scene material.
  std::uint16_t solid(std::uint32_t material, std::size_t layer, bool ground) {
    const std::array<std::size_t, 3> key{material, layer, ground ? 1U : 0U};
    const auto [found, added] =
        solids_.try_emplace(key, static_cast<std::uint16_t>(model_.grid_.materials.size()));
    if (added) {
      const scene::Layer& l = model_.materials_[material].layers[layer];
      model_.grid_.materials.push_back(
          {l.conductivity_w_m_k, l.density_kg_m3 * l.specific_heat_j_kg_k});
      model_.kinds_.push_back({material, ground});
    }
    return found->second;
  }
  /// Returns the code of cells that are held at a temperature.
  std::uint16_t held(double kelvin) {
    auto& all = model_.grid_.fixed_cell_k;
    auto found = std::find(all.begin(), all.end(), kelvin);
    if (found == all.end()) {
      // Use the last code for all further temperatures. More base temperatures than codes do not
      // occur.
      if (all.size() < 255) all.push_back(kelvin);
      found = all.end() - 1;
    }
    return static_cast<std::uint16_t>(kFixedCell + (found - all.begin()));
  }

  /// Returns the middle of a grid cell along an axis.
  [[nodiscard]] double middle(std::size_t axis, std::size_t cell) const {
    const auto& axis_lines = model_.grid_.lines_m[axis];
    return 0.5 * (axis_lines[cell] + axis_lines[cell + 1]);
  }

  /// Fills the cells below ground with the layers of the ground, and the cells below those with
  /// held cells.
  void fill_ground() {
    if (!shape_.has_ground) return;
    SolidGrid& grid = model_.grid_;
    for (std::size_t j = 0; j < grid.count(1); ++j) {
      const std::size_t sj = cell_of(shape_.planes_m[1], middle(1, j));
      for (std::size_t i = 0; i < grid.count(0); ++i) {
        const std::size_t si = cell_of(shape_.planes_m[0], middle(0, i));
        const std::uint32_t material = shape_.ground[si + shape_.count(0) * sj];
        if (material == VoxelShape::kNoGround) continue;
        const auto& layers = model_.materials_[material].layers;
        for (std::size_t k = 0; k < grid.count(2); ++k) {
          const double depth = shape_.ground_z_m - middle(2, k);
          if (depth < 0.0) break;
          // Find the layer at this depth.
          std::size_t layer = 0;
          double below = layers[0].thickness_m;
          while (layer + 1 < layers.size() && depth > below) below += layers[++layer].thickness_m;
          grid.cells[grid.index(i, j, k)] = depth > below ? held(model_.materials_[material].base_k)
                                                          : solid(material, layer, true);
        }
      }
    }
  }

  /// Fills the cells of the solids with their layers, from the open air inwards.
  void fill_solids() {
    SolidGrid& grid = model_.grid_;
    // Map every grid cell to its cell of the feature grid, per axis.
    std::array<std::vector<std::size_t>, 3> to_shape;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t c = 0; c < grid.count(axis); ++c) {
        to_shape[axis].push_back(cell_of(shape_.planes_m[axis], middle(axis, c)));
      }
    }
    std::vector<std::uint8_t> open(grid.cells.size(), 0);
    std::vector<std::uint32_t> of_material(grid.cells.size(), VoxelShape::kNoGround);
    // Mark the cells of open air, of cavities and of each material.
    for (std::size_t k = 0; k < grid.count(2); ++k) {
      if (shape_.has_ground && middle(2, k) < shape_.ground_z_m) continue;
      for (std::size_t j = 0; j < grid.count(1); ++j) {
        for (std::size_t i = 0; i < grid.count(0); ++i) {
          const std::size_t cell = grid.index(i, j, k);
          const std::size_t from = shape_.index(to_shape[0][i], to_shape[1][j], to_shape[2][k]);
          open[cell] = shape_.fill[from] == ShapeFill::open;
          model_.cavity_cell_[cell] = shape_.fill[from] == ShapeFill::cavity;
          if (shape_.fill[from] == ShapeFill::solid) of_material[cell] = shape_.material[from];
        }
      }
    }
    // Fill each solid with its first layer and replace deeper cells layer by layer.
    for (std::uint32_t m = 0; m < model_.materials_.size(); ++m) {
      if (std::find(of_material.begin(), of_material.end(), m) == of_material.end()) continue;
      const scene::Material& material = model_.materials_[m];
      for (std::size_t c = 0; c < grid.cells.size(); ++c) {
        if (of_material[c] == m) grid.cells[c] = solid(m, 0, false);
      }
      double depth = 0.0;
      for (std::size_t layer = 0; layer < material.layers.size(); ++layer) {
        depth += material.layers[layer].thickness_m;
        const bool last = layer + 1 == material.layers.size();
        // Keep the last layer up to the cavity of a hollow solid.
        if (last && hollow_[m] != 0) break;
        const std::vector<std::uint8_t> near = grown(open, depth);
        const std::uint16_t deeper = last ? held(material.base_k) : solid(m, layer + 1, false);
        for (std::size_t c = 0; c < grid.cells.size(); ++c) {
          if (of_material[c] == m && near[c] == 0) grid.cells[c] = deeper;
        }
      }
    }
  }

  /// Returns the cells that are closer than `depth` to the open air along every axis at once. The
  /// region around each open cell is a box.
  [[nodiscard]] std::vector<std::uint8_t> grown(std::vector<std::uint8_t> open,
                                                double depth) const {
    const SolidGrid& grid = model_.grid_;
    const std::array<std::size_t, 3> n{grid.count(0), grid.count(1), grid.count(2)};
    const std::array<std::size_t, 3> stride{1, n[0], n[0] * n[1]};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t u = (axis + 1) % 3;
      const std::size_t v = (axis + 2) % 3;
      const auto& axis_lines = grid.lines_m[axis];
      // Treat the space beyond the rim as open air, but not under the ground.
      const double first = axis == 2 && shape_.has_ground ? -std::numeric_limits<double>::infinity()
                                                          : axis_lines.front();
      std::vector<std::uint8_t> near(n[axis]);
      for (std::size_t b = 0; b < n[v]; ++b) {
        for (std::size_t a = 0; a < n[u]; ++a) {
          const std::size_t start = a * stride[u] + b * stride[v];
          double edge = first;
          // Sweep up, then down, and mark cells whose middle is near the last open cell.
          for (std::size_t c = 0; c < n[axis]; ++c) {
            const bool source = open[start + c * stride[axis]] != 0;
            if (source) edge = axis_lines[c + 1];
            near[c] = source || middle(axis, c) - edge < depth;
          }
          edge = axis_lines.back();
          for (std::size_t c = n[axis]; c-- > 0;) {
            if (open[start + c * stride[axis]] != 0) edge = axis_lines[c];
            if (edge - middle(axis, c) < depth) near[c] = 1;
          }
          for (std::size_t c = 0; c < n[axis]; ++c) open[start + c * stride[axis]] = near[c];
        }
      }
    }
    return open;
  }

  /// Gives the cells of every joint the conductivity that makes its resistance.
  void fill_joints() {
    SolidGrid& grid = model_.grid_;
    for (const VoxelJoint& joint : joints_) {
      std::array<std::array<std::size_t, 2>, 3> range{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double low =
            axis == joint.axis ? joint.plane_m : shape_.planes_m[axis][joint.body[axis]];
        const double high = axis == joint.axis ? joint.plane_m + joint.depth_m
                                               : shape_.planes_m[axis][joint.body[axis] + 1];
        const auto& axis_lines = grid.lines_m[axis];
        range[axis] = {cell_of(axis_lines, low + kPlaneM), cell_of(axis_lines, high - kPlaneM)};
      }
      for (std::size_t k = range[2][0]; k <= range[2][1]; ++k) {
        for (std::size_t j = range[1][0]; j <= range[1][1]; ++j) {
          for (std::size_t i = range[0][0]; i <= range[0][1]; ++i) {
            std::uint16_t& cell = grid.cells[grid.index(i, j, k)];
            if (cell < kFixedCell) cell = joint_cell(cell, joint);
          }
        }
      }
    }
  }
  /// Returns the grid material of a joint's cell in the place of another material.
  std::uint16_t joint_cell(std::uint16_t of, const VoxelJoint& joint) {
    const double conductivity = joint.depth_m / joint.resistance_m2k_w;
    for (std::size_t m = 0; m < model_.grid_.materials.size(); ++m) {
      if (model_.kinds_[m].joint_of == of &&
          model_.grid_.materials[m].conductivity_w_m_k == conductivity) {
        return static_cast<std::uint16_t>(m);
      }
    }
    model_.grid_.materials.push_back(
        {conductivity, model_.grid_.materials[of].heat_capacity_j_m3_k});
    VoxelModel::CellKind kind = model_.kinds_[of];
    kind.joint_of = of;
    model_.kinds_.push_back(kind);
    return static_cast<std::uint16_t>(model_.grid_.materials.size() - 1);
  }

  VoxelShape shape_;
  const scene::ScenarioDesc& scenario_;
  const VoxelOptions& options_;
  std::vector<VoxelJoint> joints_;
  VoxelModel model_;
  std::vector<char> hollow_;  ///< per scene material
  std::map<std::array<std::size_t, 3>, std::uint16_t> solids_;
};

Result<VoxelModel> VoxelModel::build(const scene::ScenarioDesc& scenario,
                                     const scene::SceneGeometry& geometry,
                                     const VoxelOptions& options) {
  if (!(options.normal_cell_m > 0.0 && options.swept_cell_m > 0.0 && options.max_cell_m > 0.0 &&
        options.growth_frac > 0.0 && options.refine > 0.0)) {
    return make_error(ErrorCode::invalid_argument,
                      "three-dimensional solution: cell sizes must be positive");
  }
  auto shape = voxel_shape(scenario, geometry);
  if (!shape) return tl::unexpected(std::move(shape.error()));
  return VoxelBuilder(std::move(*shape), scenario, geometry, options).build();
}

}  // namespace emit::reference
