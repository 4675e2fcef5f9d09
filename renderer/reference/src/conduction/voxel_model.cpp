// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/voxel_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "emit/physics/constants.hpp"
#include "emit/reference/solid_grid.hpp"
#include "voxel_shape.hpp"

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Lowest elevation of the sun for fine cells. Below it shadows are too faint and too long to be
/// resolved sharply.
constexpr double kLowestSunRad = 8.0 * physics::kDegree;
/// Age at which a shadow's edge has lost its sharpness.
constexpr double kEdgeAgeS = 60.0;
/// Thickness of the row of held cells under the ground. The value does not matter.
constexpr double kHeldRowM = 0.01;

/// Returns the cell that contains x, clamped to the grid.
std::size_t cell_of(const std::vector<double>& lines, double x) {
  const auto after = std::upper_bound(lines.begin(), lines.end(), x);
  const auto index = after - lines.begin() - 1;
  return static_cast<std::size_t>(
      std::clamp<std::ptrdiff_t>(index, 0, static_cast<std::ptrdiff_t>(lines.size()) - 2));
}

/// Returns the thickness of all layers.
double total_m(const scene::Material& material) {
  double sum = 0.0;
  for (const scene::Layer& layer : material.layers) sum += layer.thickness_m;
  return sum;
}

}  // namespace

/// Builds the grid of a scene step by step.
class VoxelBuilder {
 public:
  VoxelBuilder(VoxelShape shape, const scene::SceneGeometry& geometry, const VoxelOptions& options)
      : shape_(std::move(shape)), options_(options) {
    model_.materials_ = geometry.materials;
  }

  Result<VoxelModel> build() {
    if (auto good = check_materials(); !good) return tl::unexpected(std::move(good.error()));
    find_hollow();
    for (std::size_t axis = 0; axis < 3; ++axis) model_.grid_.lines_m[axis] = lines(axis);
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
    model_.shape_ = std::make_shared<const VoxelShape>(std::move(shape_));
    return std::move(model_);
  }

 private:
  /// Visits every cell of the feature grid.
  template <class Visit>
  void for_shape(Visit visit) const {
    for (std::size_t k = 0; k < shape_.count(2); ++k) {
      for (std::size_t j = 0; j < shape_.count(1); ++j) {
        for (std::size_t i = 0; i < shape_.count(0); ++i) {
          visit(i, j, k, shape_.index(i, j, k));
        }
      }
    }
  }

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
    for_shape([&](std::size_t, std::size_t, std::size_t, std::size_t cell) {
      if (result && shape_.fill[cell] == ShapeFill::solid) result = check(shape_.material[cell]);
    });
    for (const std::uint32_t material : shape_.ground) {
      if (result && material != VoxelShape::kNoGround) result = check(material);
    }
    return result;
  }

  /// Finds the materials of solids that touch a cavity. Their last layer extends to the cavity.
  void find_hollow() {
    hollow_.assign(model_.materials_.size(), 0);
    for_shape([&](std::size_t i, std::size_t j, std::size_t k, std::size_t cell) {
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

  /// Returns the grid lines of one axis. Lines lie on every plane across which the filling changes
  /// and on every boundary of a layer. They are dense at faces and in places that shadows pass.
  [[nodiscard]] std::vector<double> lines(std::size_t axis) const {
    GradedLines wanted;
    wanted.growth_frac = options_.growth_frac;
    wanted.max_size_m = options_.max_cell_m;
    wanted.refine = options_.refine;
    const std::vector<double>& planes = shape_.planes_m[axis];
    wanted.fixed_m = {planes.front(), planes.back()};
    const auto fine = [&](double at) { wanted.wishes.push_back({at, at, options_.normal_cell_m}); };
    // Put lines at the sides of solids and at the layers behind them.
    for_shape([&](std::size_t i, std::size_t j, std::size_t k, std::size_t cell) {
      if (shape_.fill[cell] != ShapeFill::solid) return;
      const std::array<std::size_t, 3> at{i, j, k};
      for (const int step : {-1, 1}) {
        const bool rim = step < 0 ? at[axis] == 0 : at[axis] + 1 == shape_.count(axis);
        ShapeFill across = ShapeFill::open;
        if (!rim) {
          std::array<std::size_t, 3> next = at;
          next[axis] += step < 0 ? std::size_t(-1) : 1;
          across = shape_.fill[shape_.index(next[0], next[1], next[2])];
        }
        if (across == ShapeFill::solid) continue;
        const double plane = planes[step < 0 ? at[axis] : at[axis] + 1];
        wanted.fixed_m.push_back(plane);
        if (across == ShapeFill::cavity) continue;
        fine(plane);
        double depth = 0.0;
        const scene::Material& material = model_.materials_[shape_.material[cell]];
        for (std::size_t l = 0; l < material.layers.size(); ++l) {
          depth += material.layers[l].thickness_m;
          const double inner = plane - step * depth;
          if (inner > planes.front() && inner < planes.back()) wanted.fixed_m.push_back(inner);
        }
      }
    });
    // Add the lines of the ground: its layers along z, its seams along x and y.
    if (axis == 2) {
      ground_lines(wanted);
    } else {
      ground_seams(axis, wanted);
    }
    swept(axis, wanted);
    return graded_lines(wanted, 1e-5);
  }

  /// Adds lines at the layers of the ground and below the deepest one.
  void ground_lines(GradedLines& wanted) const {
    if (!shape_.has_ground) return;
    double deepest = 0.0;
    for (const std::uint32_t index : shape_.ground) {
      if (index == VoxelShape::kNoGround) continue;
      double depth = 0.0;
      for (const scene::Layer& layer : model_.materials_[index].layers) {
        depth += layer.thickness_m;
        wanted.fixed_m.push_back(shape_.ground_z_m - depth);
      }
      deepest = std::max(deepest, depth);
    }
    wanted.fixed_m.push_back(shape_.ground_z_m);
    wanted.fixed_m.push_back(shape_.ground_z_m - deepest - kHeldRowM);
    wanted.wishes.push_back({shape_.ground_z_m, shape_.ground_z_m, options_.normal_cell_m});
  }

  /// Adds lines where ground of one material meets ground of another, or ends.
  void ground_seams(std::size_t axis, GradedLines& wanted) const {
    if (!shape_.has_ground) return;
    const std::size_t nx = shape_.count(0);
    const std::size_t ny = shape_.count(1);
    for (std::size_t j = 0; j < ny; ++j) {
      for (std::size_t i = 0; i < nx; ++i) {
        const std::size_t next_i = axis == 0 ? i + 1 : i;
        const std::size_t next_j = axis == 1 ? j + 1 : j;
        if (next_i >= nx || next_j >= ny) continue;
        if (shape_.ground[i + nx * j] == shape_.ground[next_i + nx * next_j]) continue;
        const double seam = shape_.planes_m[axis][axis == 0 ? next_i : next_j];
        wanted.fixed_m.push_back(seam);
        wanted.wishes.push_back({seam, seam, options_.normal_cell_m});
      }
    }
  }

  /// Asks for fine cells along an axis over all places that shadows of the solids swept.
  void swept(std::size_t axis, GradedLines& wanted) const {
    double low = kInfinity;
    double high = -kInfinity;
    const double floor = shape_.has_ground ? shape_.ground_z_m : shape_.planes_m[2].front();
    // Find the range of the solids and of their shadows on the floor.
    for_shape([&](std::size_t i, std::size_t j, std::size_t k, std::size_t cell) {
      if (shape_.fill[cell] != ShapeFill::solid) return;
      const std::size_t at = axis == 0 ? i : axis == 1 ? j : k;
      for (const PastSun& past : options_.suns) {
        const glm::dvec3& sun = past.to_sun;
        if (sun.z < std::sin(kLowestSunRad)) continue;
        for (const std::size_t plane : {at, at + 1}) {
          const double x = shape_.planes_m[axis][plane];
          const double up = shape_.planes_m[2][k + 1] - floor;
          const auto component = static_cast<glm::dvec3::length_type>(axis);
          const double shifted = axis == 2 ? x : x - sun[component] / sun.z * up;
          low = std::min({low, x, shifted});
          high = std::max({high, x, shifted});
        }
      }
    });
    // Ask for fine cells in this range, inside the scene.
    if (!(low < high)) return;
    low = std::max(low, shape_.planes_m[axis].front());
    high = std::min(high, shape_.planes_m[axis].back());
    wanted.wishes.push_back({low, high, options_.swept_cell_m});
    if (axis != 2) sharp_edges(axis, floor, wanted);
  }

  /// Asks for small cells across the edges of shadows on the floor that are still sharp. Conduction
  /// smooths older edges over sqrt(4 a t) of ground (a = 6e-7 m2/s: 12 mm in a minute).
  void sharp_edges(std::size_t axis, double floor, GradedLines& wanted) const {
    const std::size_t other = 1 - axis;
    const auto along = static_cast<glm::dvec3::length_type>(axis);
    const auto across = static_cast<glm::dvec3::length_type>(other);
    const auto open = [&](std::array<std::size_t, 3> at, std::size_t a, int step) {
      if (step < 0 ? at[a] == 0 : at[a] + 1 == shape_.count(a)) return true;
      at[a] += step < 0 ? std::size_t(-1) : 1;
      return shape_.fill[shape_.index(at[0], at[1], at[2])] == ShapeFill::open;
    };
    for (std::size_t s = 0; s < options_.suns.size(); ++s) {
      // Let the wanted cell grow with the age of the shadow.
      const double size =
          options_.shadow_cell_m * std::sqrt(1.0 + options_.suns[s].age_s / kEdgeAgeS);
      if (size >= options_.swept_cell_m) continue;
      const glm::dvec3& sun = options_.suns[s].to_sun;
      // Cover the way of the edge since the sun sample before.
      const glm::dvec3& before = options_.suns[s > 0 ? s - 1 : 0].to_sun;
      if (std::min(sun.z, before.z) < std::sin(kLowestSunRad)) continue;
      const double level = std::hypot(sun.x, sun.y);
      for_shape([&](std::size_t i, std::size_t j, std::size_t k, std::size_t cell) {
        if (shape_.fill[cell] != ShapeFill::solid) return;
        const std::array<std::size_t, 3> at{i, j, k};
        const double bottom = shape_.planes_m[2][k] - floor;
        const double top = shape_.planes_m[2][k + 1] - floor;
        if (!(top > 0.0)) return;
        // Project a part of an edge to the floor from both positions of the sun.
        const auto wish = [&](double x, double low, double high, double cell_m) {
          if (cell_m >= options_.swept_cell_m) return;
          const std::array<double, 4> ends{
              x - sun[along] / sun.z * low, x - sun[along] / sun.z * high,
              x - before[along] / before.z * low, x - before[along] / before.z * high};
          const auto [first, last] = std::ranges::minmax(ends);
          wanted.wishes.push_back({std::max(first, shape_.planes_m[axis].front()),
                                   std::min(last, shape_.planes_m[axis].back()), cell_m});
        };
        for (const int step : {-1, 1}) {
          if (!open(at, axis, step)) continue;
          const double x = shape_.planes_m[axis][step < 0 ? at[axis] : at[axis] + 1];
          const bool lit = step * sun[along] > 0.0;
          // Horizontal edges lie between the lit top and an unlit side.
          if (!lit && open(at, 2, 1)) wish(x, top, top, size);
          // Upright edges lie between a lit and an unlit side. Their shadow runs away from the sun.
          for (const int side : {-1, 1}) {
            if (!open(at, other, side) || (side * sun[across] > 0.0) == lit) continue;
            wish(x, std::max(bottom, 0.0), top,
                 size * level / std::max(std::abs(sun[across]), 1e-3 * level));
          }
        }
      });
    }
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
      const double first = axis == 2 && shape_.has_ground ? -kInfinity : axis_lines.front();
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

  VoxelShape shape_;
  const VoxelOptions& options_;
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
  return VoxelBuilder(std::move(*shape), geometry, options).build();
}

bool VoxelModel::fits(const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry) {
  return voxel_shape(scenario, geometry).has_value();
}

FaceCondition VoxelModel::condition(const SolidFace& face) const {
  const CellKind& kind = kinds_[face.material];
  const scene::Material& material = materials_[kind.material];
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

VoxelFace VoxelModel::face(const SolidFace& face) const {
  return {kinds_[face.material].material,
          face.outside_cell != kOutsideGrid && cavity_cell_[face.outside_cell] != 0};
}

double VoxelModel::steady_k(const glm::dvec3& point_m, double initial_k) const {
  const VoxelShape& shape = *shape_;
  // Find the cell of the feature grid.
  std::array<std::size_t, 3> at{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    at[axis] = cell_of(shape.planes_m[axis], point_m[static_cast<glm::dvec3::length_type>(axis)]);
  }
  double depth = kInfinity;
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
    depth = kInfinity;
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
  // Divide the steady drop of temperature by the resistance above the point.
  double whole = 0.0;
  double above = 0.0;
  double left = std::min(std::max(depth, 0.0), total_m(material));
  for (const scene::Layer& layer : material.layers) {
    const double part = std::min(left, layer.thickness_m);
    above += part / layer.conductivity_w_m_k;
    left -= part;
    whole += layer.thickness_m / layer.conductivity_w_m_k;
  }
  const double surface_k = material.initial_k.value_or(initial_k);
  return surface_k + (material.base_k - surface_k) * above / whole;
}

FaceFinder::FaceFinder(const SolidGrid& grid, std::span<const SolidFace> faces)
    : lines_m_(grid.lines_m) {
  faces_.reserve(faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const std::uint64_t key = faces[f].cell * std::uint64_t{6} + faces[f].axis * std::uint64_t{2} +
                              (faces[f].sign > 0 ? 1U : 0U);
    faces_.emplace(key, static_cast<std::uint32_t>(f));
  }
}

std::optional<std::uint32_t> FaceFinder::find(const glm::dvec3& point_m,
                                              const glm::dvec3& normal) const {
  constexpr double kNudgeM = 2e-5;
  // Take the axis of the normal.
  std::size_t axis = 0;
  for (std::size_t a = 1; a < 3; ++a) {
    if (std::abs(normal[static_cast<glm::dvec3::length_type>(a)]) >
        std::abs(normal[static_cast<glm::dvec3::length_type>(axis)])) {
      axis = a;
    }
  }
  const bool up = normal[static_cast<glm::dvec3::length_type>(axis)] > 0.0;
  const std::size_t u = axis == 0 ? 1 : 0;
  const std::size_t v = axis == 2 ? 1 : 2;
  const auto component = [&](std::size_t a) {
    return point_m[static_cast<glm::dvec3::length_type>(a)];
  };
  const std::uint64_t nx = lines_m_[0].size() - 1;
  const std::uint64_t ny = lines_m_[1].size() - 1;
  static constexpr std::array<std::array<double, 2>, 9> kTries{
      {{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, 1}, {1, -1}, {-1, -1}}};
  for (const auto& nudge : kTries) {
    std::array<std::size_t, 3> cell{};
    // Look just inside the solid; nudge the point sideways if it lies between two faces.
    cell[axis] = cell_of(lines_m_[axis], component(axis) + (up ? -kNudgeM : kNudgeM));
    cell[u] = cell_of(lines_m_[u], component(u) + kNudgeM * nudge[0]);
    cell[v] = cell_of(lines_m_[v], component(v) + kNudgeM * nudge[1]);
    const std::uint64_t index = cell[0] + nx * (cell[1] + ny * cell[2]);
    const auto found = faces_.find(index * 6 + axis * 2 + (up ? 1U : 0U));
    if (found != faces_.end()) return found->second;
  }
  return std::nullopt;
}

}  // namespace emit::reference
