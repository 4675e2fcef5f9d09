// SPDX-License-Identifier: Apache-2.0
#include "voxel_lines.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/vec3.hpp>
#include <limits>

#include "emit/physics/constants.hpp"
#include "emit/reference/solid_grid.hpp"

namespace emit::reference {
namespace {

/// Lowest elevation of the sun for fine cells. Below it shadows are too faint and too long to be
/// resolved sharply.
constexpr double kLowestSunRad = 8.0 * physics::kDegree;
/// Age at which a shadow's edge has lost its sharpness.
constexpr double kEdgeAgeS = 60.0;
/// Number of cells across a layer at refine 1, at least.
constexpr double kLayerCells = 2.0;

/// Chooses the grid lines of a scene.
class LineChoice {
 public:
  LineChoice(const VoxelShape& shape, std::span<const scene::Material> materials,
             std::span<const VoxelJoint> joints, const VoxelOptions& options)
      : shape_(shape), materials_(materials), joints_(joints), options_(options) {}

  /// Returns the lines of one axis.
  [[nodiscard]] std::vector<double> lines(std::size_t axis) const {
    GradedLines wanted;
    wanted.growth_frac = options_.growth_frac;
    wanted.max_size_m = options_.max_cell_m;
    wanted.refine = options_.refine;
    const std::vector<double>& planes = shape_.planes_m[axis];
    wanted.fixed_m = {planes.front(), planes.back()};
    const auto fine = [&](double at) { wanted.wishes.push_back({at, at, options_.normal_cell_m}); };
    // Put lines at the sides of solids and at the layers behind them.
    shape_.for_cells([&](std::size_t i, std::size_t j, std::size_t k, std::size_t cell) {
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
        const double plane = planes[step < 0 ? at[axis] : at[axis] + 1];
        if (across == ShapeFill::solid) {
          seam(at, axis, step, plane, wanted);
          continue;
        }
        wanted.fixed_m.push_back(plane);
        if (across == ShapeFill::cavity) continue;
        fine(plane);
        double depth = 0.0;
        const scene::Material& material = materials_[shape_.material[cell]];
        for (const scene::Layer& layer : material.layers) {
          const double outer = plane - step * depth;
          depth += layer.thickness_m;
          const double inner = plane - step * depth;
          if (inner > planes.front() && inner < planes.back()) wanted.fixed_m.push_back(inner);
          layer_cells(outer, inner, layer.thickness_m, wanted);
        }
      }
    });
    // Add the lines of the ground: its layers along z, its seams along x and y.
    if (axis == 2) {
      ground_lines(wanted);
    } else {
      ground_seams(axis, wanted);
    }
    for (const VoxelJoint& joint : joints_) {
      if (joint.axis == axis) wanted.fixed_m.push_back(joint.plane_m + joint.depth_m);
    }
    swept(axis, wanted);
    return graded_lines(wanted, 1e-5);
  }

 private:
  /// Asks for a few cells across a layer, so that thin ones are resolved.
  static void layer_cells(double from_m, double to_m, double thickness_m, GradedLines& wanted) {
    wanted.wishes.push_back(
        {std::min(from_m, to_m), std::max(from_m, to_m), thickness_m / kLayerCells});
  }

  /// Adds a line where a solid touches a solid of another material.
  void seam(std::array<std::size_t, 3> at, std::size_t axis, int step, double plane,
            GradedLines& wanted) const {
    const std::uint32_t mine = shape_.material[shape_.index(at[0], at[1], at[2])];
    at[axis] += step < 0 ? std::size_t(-1) : 1;
    if (shape_.material[shape_.index(at[0], at[1], at[2])] == mine) return;
    wanted.fixed_m.push_back(plane);
    wanted.wishes.push_back({plane, plane, options_.normal_cell_m});
  }

  /// Adds lines at the layers of the ground and below the deepest one.
  void ground_lines(GradedLines& wanted) const {
    if (!shape_.has_ground) return;
    double deepest = 0.0;
    for (const std::uint32_t index : shape_.ground) {
      if (index == VoxelShape::kNoGround) continue;
      double depth = 0.0;
      for (const scene::Layer& layer : materials_[index].layers) {
        const double top = shape_.ground_z_m - depth;
        depth += layer.thickness_m;
        wanted.fixed_m.push_back(shape_.ground_z_m - depth);
        layer_cells(top, shape_.ground_z_m - depth, layer.thickness_m, wanted);
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
    double low = std::numeric_limits<double>::infinity();
    double high = -std::numeric_limits<double>::infinity();
    const double floor = shape_.has_ground ? shape_.ground_z_m : shape_.planes_m[2].front();
    // Find the range of the solids and of their shadows on the floor.
    shape_.for_cells([&](std::size_t i, std::size_t j, std::size_t k, std::size_t cell) {
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
      shape_.for_cells([&](std::size_t i, std::size_t j, std::size_t k, std::size_t cell) {
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
  const VoxelShape& shape_;
  std::span<const scene::Material> materials_;
  std::span<const VoxelJoint> joints_;
  const VoxelOptions& options_;
};

}  // namespace

std::vector<double> voxel_lines(std::size_t axis, const VoxelShape& shape,
                                std::span<const scene::Material> materials,
                                std::span<const VoxelJoint> joints, const VoxelOptions& options) {
  return LineChoice(shape, materials, joints, options).lines(axis);
}

}  // namespace emit::reference
