// SPDX-License-Identifier: Apache-2.0
#include "voxel_shape.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <queue>

#include "voxel_triangles.hpp"

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Builds the feature grid of a scene step by step.
class ShapeBuilder {
 public:
  ShapeBuilder(const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry)
      : scenario_(scenario), geometry_(geometry) {}

  Result<VoxelShape> build() {
    auto triangles = voxel_triangles(scenario_, geometry_);
    if (!triangles) return tl::unexpected(std::move(triangles.error()));
    triangles_ = std::move(*triangles);
    if (auto done = find_planes(); !done) return tl::unexpected(std::move(done.error()));
    cover_faces();
    if (auto done = fill_cells(); !done) return tl::unexpected(std::move(done.error()));
    if (auto done = give_materials(); !done) return tl::unexpected(std::move(done.error()));
    add_sheets();
    mark_cavities();
    open_cavities_of_sheets();
    note_covers();
    return std::move(shape_);
  }

 private:
  [[nodiscard]] tl::unexpected<physics::Error> refuse(std::uint32_t object,
                                                      std::string text) const {
    return refuse_shape(scenario_, object, std::move(text));
  }

  /// Collects the planes of each axis and the height of the ground.
  Result<void> find_planes() {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::vector<double> all;
      for (const VoxelTriangle& t : triangles_) {
        for (const glm::dvec3& p : t.p_m) {
          // Take every vertex. Planes inside a face do no harm: they only refine the feature grid.
          all.push_back(p[vector_index(axis)]);
        }
        if (t.sheet_m > 0.0 && t.axis == axis) all.push_back(back_m(t));
      }
      std::sort(all.begin(), all.end());
      std::vector<double>& planes = shape_.planes_m[axis];
      for (const double x : all) {
        // Round to a micrometre, which removes the error of float32, and merge planes that are
        // equal.
        const double rounded = std::round(x * 1e6) * 1e-6;
        if (planes.empty() || rounded > planes.back() + kPlaneM) planes.push_back(rounded);
      }
      if (planes.size() > 400) {
        return make_error(ErrorCode::unsupported,
                          "three-dimensional solution: more than 400 planes along one axis");
      }
      if (planes.size() < 2) {
        // Add a cell of air above ground that stands alone.
        planes.push_back(planes.back() + 1.0);
      }
    }
    // Check that all ground lies at one height.
    for (const VoxelTriangle& t : triangles_) {
      if (!t.ground) continue;
      const double z = shape_.planes_m[2][plane(2, t.p_m[0].z)];
      if (shape_.has_ground && z != shape_.ground_z_m) {
        return refuse(t.object, "ground at several heights is not handled");
      }
      shape_.has_ground = true;
      shape_.ground_z_m = z;
    }
    return {};
  }

  /// Returns the place of the back of a sheet along the axis of its normal.
  static double back_m(const VoxelTriangle& t) {
    return t.p_m[0][vector_index(t.axis)] - t.sign * t.sheet_m;
  }

  /// Returns the index of the plane at x.
  [[nodiscard]] std::size_t plane(std::size_t axis, double x) const {
    const std::vector<double>& planes = shape_.planes_m[axis];
    const auto after = std::lower_bound(planes.begin(), planes.end(), x - kPlaneM);
    return std::min(static_cast<std::size_t>(after - planes.begin()), planes.size() - 1);
  }

  /// Marks the rectangles of the feature grid that triangles cover, by the centres of the
  /// rectangles.
  void cover_faces() {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::array<std::size_t, 3> n{shape_.count(0), shape_.count(1), shape_.count(2)};
      ++n[axis];
      faces_[axis].assign(n[0] * n[1] * n[2], Cover{});
    }
    shape_.ground.assign(shape_.count(0) * shape_.count(1), VoxelShape::kNoGround);
    shape_.ground_object = shape_.ground;
    for (const VoxelTriangle& t : triangles_) {
      if (t.sheet_m > 0.0) continue;
      for_rectangles(t, [&](const std::array<std::size_t, 3>& cell) {
        if (t.ground) {
          shape_.ground[cell[0] + shape_.count(0) * cell[1]] = t.material;
          shape_.ground_object[cell[0] + shape_.count(0) * cell[1]] = t.object;
          return;
        }
        Cover& cover = faces_[t.axis][shape_.face_index(t.axis, cell)];
        (t.sign > 0 ? cover.up : cover.down) = true;
        (t.sign > 0 ? cover.up_material : cover.down_material) = t.material;
        (t.sign > 0 ? cover.up_object : cover.down_object) = t.object;
      });
    }
  }
  /// Visits the rectangles of the feature grid that a triangle covers.
  template <class Visit>
  void for_rectangles(const VoxelTriangle& t, Visit visit) const {
    const std::size_t u = (t.axis + 1) % 3;
    const std::size_t v = (t.axis + 2) % 3;
    std::array<std::size_t, 3> cell{};
    cell[t.axis] = plane(t.axis, t.p_m[0][vector_index(t.axis)]);
    // Visit the rectangles within the bounds of the triangle.
    const auto range = [&](std::size_t axis) {
      const auto [low, high] =
          std::minmax({t.p_m[0][vector_index(axis)], t.p_m[1][vector_index(axis)],
                       t.p_m[2][vector_index(axis)]});
      return std::pair(plane(axis, low), plane(axis, high));
    };
    const auto [u0, u1] = range(u);
    const auto [v0, v1] = range(v);
    for (cell[u] = u0; cell[u] < u1; ++cell[u]) {
      for (cell[v] = v0; cell[v] < v1; ++cell[v]) {
        if (inside(t, u, v, middle(u, cell[u]), middle(v, cell[v]))) visit(cell);
      }
    }
  }
  /// Returns the middle of a cell along an axis.
  [[nodiscard]] double middle(std::size_t axis, std::size_t cell) const {
    return 0.5 * (shape_.planes_m[axis][cell] + shape_.planes_m[axis][cell + 1]);
  }
  /// Returns true if a triangle contains the point (x, y) of its plane.
  static bool inside(const VoxelTriangle& t, std::size_t u, std::size_t v, double x, double y) {
    double least = 0.0;
    double greatest = 0.0;
    for (std::size_t c = 0; c < 3; ++c) {
      const glm::dvec3& a = t.p_m[c];
      const glm::dvec3& b = t.p_m[(c + 1) % 3];
      const double side = (b[vector_index(u)] - a[vector_index(u)]) * (y - a[vector_index(v)]) -
                          (b[vector_index(v)] - a[vector_index(v)]) * (x - a[vector_index(u)]);
      least = std::min(least, side);
      greatest = std::max(greatest, side);
    }
    // Accept a small error: a centre on the diagonal between two triangles may count for both.
    const double slack = 1e-9 * (greatest - least);
    return least >= -slack || greatest <= slack;
  }

  /// Visits the six sides of a cell: their cover, and the cell across if there is one.
  template <class Visit>
  void for_neighbours(const std::array<std::size_t, 3>& cell, Visit visit) const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const int step : {-1, 1}) {
        std::array<std::size_t, 3> face = cell;
        if (step > 0) ++face[axis];
        const bool outside = step < 0 ? cell[axis] == 0 : cell[axis] + 1 == shape_.count(axis);
        std::array<std::size_t, 3> next = cell;
        if (!outside) next[axis] += step < 0 ? std::size_t(-1) : 1;
        visit(axis, step, faces_[axis][shape_.face_index(axis, face)], outside, next);
      }
    }
  }

  /// Fills the solids. Crossing a covered rectangle changes between inside and outside, starting at
  /// the rim.
  Result<void> fill_cells() {
    const std::size_t cells = shape_.count(0) * shape_.count(1) * shape_.count(2);
    enum : char { kUnknown, kOut, kIn };
    std::vector<char> state(cells, kUnknown);
    std::queue<std::array<std::size_t, 3>> open;
    const auto put = [&](const std::array<std::size_t, 3>& cell, char value) {
      char& mine = state[shape_.index(cell[0], cell[1], cell[2])];
      if (mine == kUnknown) {
        mine = value;
        open.push(cell);
      }
      return mine == value;
    };
    // Start at the rim: a cover that faces one way separates the inside from the air around the
    // scene.
    for (std::size_t k = 0; k < shape_.count(2); ++k) {
      for (std::size_t j = 0; j < shape_.count(1); ++j) {
        for (std::size_t i = 0; i < shape_.count(0); ++i) {
          const std::array<std::size_t, 3> cell{i, j, k};
          bool good = true;
          std::uint32_t object = 0;
          for_neighbours(cell,
                         [&](std::size_t, int, const Cover& cover, bool outside, const auto&) {
                           if (!outside) return;
                           object = cover.object();
                           good = put(cell, cover.up != cover.down ? kIn : kOut) && good;
                         });
          if (!good) return refuse(object, "its faces do not close a solid");
        }
      }
    }
    if (open.empty()) return refuse(0, "its faces do not close a solid");
    // Walk inwards and change the state at every cover that faces one way.
    while (!open.empty()) {
      const auto cell = open.front();
      open.pop();
      const char mine = state[shape_.index(cell[0], cell[1], cell[2])];
      bool good = true;
      std::uint32_t object = 0;
      for_neighbours(cell,
                     [&](std::size_t, int, const Cover& cover, bool outside, const auto& next) {
                       if (outside) return;
                       const char other = mine == kIn ? char{kOut} : char{kIn};
                       const char wanted = cover.up == cover.down ? mine : other;
                       if (!put(next, wanted)) {
                         good = false;
                         object = cover.object();
                       }
                     });
      if (!good) return refuse(object, "its faces do not close a solid");
    }
    shape_.fill.resize(cells);
    for (std::size_t c = 0; c < cells; ++c) {
      shape_.fill[c] = state[c] == kIn ? ShapeFill::solid : ShapeFill::cavity;
    }
    return {};
  }

  /// Marks the air that reaches the rim without crossing ground or a face as open. All other air is
  /// a cavity.
  void mark_cavities() {
    std::queue<std::array<std::size_t, 3>> open;
    const auto take = [&](const std::array<std::size_t, 3>& cell) {
      ShapeFill& fill = shape_.fill[shape_.index(cell[0], cell[1], cell[2])];
      if (fill != ShapeFill::cavity) return;
      fill = ShapeFill::open;
      open.push(cell);
    };
    // Start at the open sides of the rim.
    for (std::size_t k = 0; k < shape_.count(2); ++k) {
      for (std::size_t j = 0; j < shape_.count(1); ++j) {
        for (std::size_t i = 0; i < shape_.count(0); ++i) {
          const std::array<std::size_t, 3> cell{i, j, k};
          for_neighbours(
              cell, [&](std::size_t axis, int step, const Cover& cover, bool outside, const auto&) {
                if (!outside || cover.up || cover.down) return;
                // Skip the rim below a cell if ground closes it.
                if (axis == 2 && step < 0 && ground_at(cell, k)) return;
                take(cell);
              });
        }
      }
    }
    // Walk through all air that is connected to it.
    while (!open.empty()) {
      const auto cell = open.front();
      open.pop();
      for_neighbours(cell, [&](std::size_t axis, int step, const Cover& cover, bool outside,
                               const auto& next) {
        if (outside || cover.up || cover.down) return;
        if (axis == 2 && ground_at(cell, step > 0 ? cell[2] + 1 : cell[2])) return;
        take(next);
      });
    }
  }
  /// Returns true if ground lies on a plane below or above a cell.
  [[nodiscard]] bool ground_at(const std::array<std::size_t, 3>& cell, std::size_t plane_z) const {
    return shape_.has_ground && shape_.planes_m[2][plane_z] == shape_.ground_z_m &&
           shape_.ground[cell[0] + shape_.count(0) * cell[1]] != VoxelShape::kNoGround;
  }

  /// Gives every solid the material of its faces. Several materials of one solid differ in their
  /// optics alone.
  Result<void> give_materials() {
    const std::size_t cells = shape_.fill.size();
    shape_.material.assign(cells, VoxelShape::kNoGround);
    shape_.object.assign(cells, VoxelShape::kNoGround);
    std::vector<char> seen(cells, 0);
    for (std::size_t k = 0; k < shape_.count(2); ++k) {
      for (std::size_t j = 0; j < shape_.count(1); ++j) {
        for (std::size_t i = 0; i < shape_.count(0); ++i) {
          const std::size_t cell = shape_.index(i, j, k);
          if (shape_.fill[cell] != ShapeFill::solid || seen[cell] != 0) continue;
          if (auto given = give_material({i, j, k}, seen); !given) return given;
        }
      }
    }
    return {};
  }
  /// Gives the solid around a cell its material and its object.
  Result<void> give_material(const std::array<std::size_t, 3>& first, std::vector<char>& seen) {
    std::vector<std::array<std::size_t, 3>> body{first};
    seen[shape_.index(first[0], first[1], first[2])] = 1;
    std::uint32_t material = VoxelShape::kNoGround;
    std::uint32_t object = 0;
    bool mixed = false;
    // Gather the connected cells of the solid and the materials of all its faces.
    for (std::size_t b = 0; b < body.size(); ++b) {
      const auto cell = body[b];
      for_neighbours(cell, [&](std::size_t, int step, const Cover& cover, bool outside,
                               const std::array<std::size_t, 3>& next) {
        if (cover.up || cover.down) {
          // Only the face that looks out of this cell is the solid's own.
          if (!(step > 0 ? cover.up : cover.down)) return;
          const std::uint32_t mine = step > 0 ? cover.up_material : cover.down_material;
          mixed |= material != VoxelShape::kNoGround && !same_body(material, mine);
          if (material == VoxelShape::kNoGround) material = mine;
          object = step > 0 ? cover.up_object : cover.down_object;
          return;
        }
        const std::size_t other = shape_.index(next[0], next[1], next[2]);
        if (outside || seen[other] != 0 || shape_.fill[other] != ShapeFill::solid) return;
        seen[other] = 1;
        body.push_back(next);
      });
    }
    if (mixed) {
      return refuse(object, "one body shows materials with different layers or different bases");
    }
    for (const auto& cell : body) {
      shape_.material[shape_.index(cell[0], cell[1], cell[2])] = material;
      shape_.object[shape_.index(cell[0], cell[1], cell[2])] = object;
    }
    return {};
  }
  /// Returns true if two materials differ in nothing but their optics.
  [[nodiscard]] bool same_body(std::uint32_t a, std::uint32_t b) const {
    const scene::Material& first = geometry_.materials[a];
    const scene::Material& second = geometry_.materials[b];
    return a == b ||
           (first.base_k == second.base_k && first.initial_k == second.initial_k &&
            std::ranges::equal(first.layers, second.layers, [](const auto& x, const auto& y) {
              return x.thickness_m == y.thickness_m &&
                     x.conductivity_w_m_k == y.conductivity_w_m_k &&
                     x.density_kg_m3 == y.density_kg_m3 &&
                     x.specific_heat_j_kg_k == y.specific_heat_j_kg_k;
            }));
  }

  /// Fills the space behind the front of every sheet, except inside solids.
  void add_sheets() {
    for (const VoxelTriangle& t : triangles_) {
      if (!(t.sheet_m > 0.0)) continue;
      shape_.thickest_sheet_m = std::max(shape_.thickest_sheet_m, t.sheet_m);
      const std::size_t front = plane(t.axis, t.p_m[0][vector_index(t.axis)]);
      const std::size_t back = plane(t.axis, back_m(t));
      for_rectangles(t, [&](std::array<std::size_t, 3> cell) {
        for (cell[t.axis] = std::min(front, back); cell[t.axis] < std::max(front, back);
             ++cell[t.axis]) {
          const std::size_t index = shape_.index(cell[0], cell[1], cell[2]);
          if (shape_.fill[index] == ShapeFill::solid) continue;
          shape_.fill[index] = ShapeFill::solid;
          shape_.material[index] = t.material;
          shape_.object[index] = t.object;
        }
      });
    }
  }

  /// Opens every cavity that a sheet borders on: its walls exchange radiation as all others do.
  void open_cavities_of_sheets() {
    std::queue<std::array<std::size_t, 3>> open;
    const auto take = [&](const std::array<std::size_t, 3>& cell) {
      ShapeFill& fill = shape_.fill[shape_.index(cell[0], cell[1], cell[2])];
      if (fill != ShapeFill::cavity) return;
      fill = ShapeFill::open;
      open.push(cell);
    };
    for (std::size_t k = 0; k < shape_.count(2); ++k) {
      for (std::size_t j = 0; j < shape_.count(1); ++j) {
        for (std::size_t i = 0; i < shape_.count(0); ++i) {
          const std::size_t cell = shape_.index(i, j, k);
          if (shape_.fill[cell] != ShapeFill::solid) continue;
          if (!geometry_.materials[shape_.material[cell]].sheet) continue;
          for_neighbours({i, j, k},
                         [&](std::size_t, int, const Cover&, bool outside, const auto& next) {
                           if (!outside) take(next);
                         });
        }
      }
    }
    while (!open.empty()) {
      const auto cell = open.front();
      open.pop();
      for_neighbours(cell, [&](std::size_t axis, int step, const Cover& cover, bool outside,
                               const auto& next) {
        if (outside || cover.up || cover.down) return;
        if (axis == 2 && ground_at(cell, step > 0 ? cell[2] + 1 : cell[2])) return;
        take(next);
      });
    }
  }

  /// Notes the materials of all covers in the shape.
  void note_covers() {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      shape_.cover[axis].reserve(faces_[axis].size());
      for (const Cover& cover : faces_[axis]) {
        shape_.cover[axis].push_back({cover.down ? cover.down_material : VoxelShape::kNoGround,
                                      cover.up ? cover.up_material : VoxelShape::kNoGround});
      }
    }
  }

  struct Cover {
    bool up = false;    ///< the face's outside lies towards greater coordinates
    bool down = false;  ///< the face's outside lies towards smaller coordinates
    std::uint32_t up_material = 0;
    std::uint32_t down_material = 0;
    std::uint32_t up_object = 0;
    std::uint32_t down_object = 0;
    [[nodiscard]] std::uint32_t object() const { return up ? up_object : down_object; }
  };

  const scene::ScenarioDesc& scenario_;
  const scene::SceneGeometry& geometry_;
  VoxelShape shape_;
  std::vector<VoxelTriangle> triangles_;
  std::array<std::vector<Cover>, 3> faces_;
};

}  // namespace

Result<VoxelShape> voxel_shape(const scene::ScenarioDesc& scenario,
                               const scene::SceneGeometry& geometry) {
  return ShapeBuilder(scenario, geometry).build();
}

}  // namespace emit::reference
