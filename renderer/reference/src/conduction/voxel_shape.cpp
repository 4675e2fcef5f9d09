// SPDX-License-Identifier: Apache-2.0
#include "voxel_shape.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <queue>

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Largest distance of two planes that count as one. Vertices are float32.
constexpr double kMergeM = 2e-5;

/// Triangle of a scene in world axes, with the axis and direction of its normal.
struct Triangle {
  std::array<glm::dvec3, 3> p_m;
  std::size_t axis = 0;
  int sign = 1;
  std::uint32_t material = 0;
  std::uint32_t object = 0;
  bool ground = false;
};

glm::dvec3::length_type at(std::size_t axis) {
  return static_cast<glm::dvec3::length_type>(axis);
}

/// Builds the feature grid of a scene step by step.
class ShapeBuilder {
 public:
  ShapeBuilder(const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry)
      : scenario_(scenario), geometry_(geometry) {}

  Result<VoxelShape> build() {
    if (auto done = collect(); !done) return tl::unexpected(std::move(done.error()));
    find_ground();
    if (auto done = find_planes(); !done) return tl::unexpected(std::move(done.error()));
    cover_faces();
    if (auto done = fill_cells(); !done) return tl::unexpected(std::move(done.error()));
    mark_cavities();
    if (auto done = give_materials(); !done) return tl::unexpected(std::move(done.error()));
    return std::move(shape_);
  }

 private:
  /// Returns the error for a scene that is not handled, naming the object.
  [[nodiscard]] tl::unexpected<physics::Error> refuse(std::uint32_t object,
                                                      std::string text) const {
    const std::string name =
        object < scenario_.objects.size() ? scenario_.objects[object].name : std::string();
    return make_error(ErrorCode::unsupported,
                      fmt::format("three-dimensional solution: object '{}': {}", name, text));
  }

  /// Collects the triangles and refuses what the model does not handle.
  Result<void> collect() {
    for (const scene::Instance& instance : geometry_.instances) {
      if (instance.entity_id != 0) return refuse(instance.object, "moving objects are not handled");
      const scene::Mesh& mesh = geometry_.meshes[instance.mesh];
      for (const scene::Submesh& submesh : mesh.submeshes) {
        if (geometry_.materials[submesh.material].prescribed_k) {
          return refuse(instance.object, "an emitter of given temperature is not handled");
        }
        for (std::uint32_t i = 0; i + 2 < submesh.index_count; i += 3) {
          Triangle t;
          t.material = submesh.material;
          t.object = instance.object;
          for (std::size_t c = 0; c < 3; ++c) {
            const glm::vec3& p = mesh.positions_m[mesh.indices[submesh.first_index + i +
                                                               static_cast<std::uint32_t>(c)]];
            t.p_m[c] = glm::dvec3(instance.world_from_mesh * glm::dvec4(glm::dvec3(p), 1.0));
          }
          // Find the axis of the normal and check that the triangle lies across it.
          const glm::dvec3 normal = glm::cross(t.p_m[1] - t.p_m[0], t.p_m[2] - t.p_m[0]);
          if (glm::length(normal) < 1e-12) continue;
          for (std::size_t axis = 1; axis < 3; ++axis) {
            if (std::abs(normal[at(axis)]) > std::abs(normal[at(t.axis)])) t.axis = axis;
          }
          t.sign = normal[at(t.axis)] > 0.0 ? 1 : -1;
          const double a = t.p_m[0][at(t.axis)];
          if (std::abs(t.p_m[1][at(t.axis)] - a) > kMergeM ||
              std::abs(t.p_m[2][at(t.axis)] - a) > kMergeM) {
            return refuse(instance.object, "a face does not lie across one of the world's axes");
          }
          // Note the instance of the triangle, which find_ground() needs. A node's primitives form
          // one solid.
          part_.push_back(part_of(instance));
          triangles_.push_back(t);
        }
      }
    }
    if (triangles_.empty()) {
      return make_error(ErrorCode::unsupported, "three-dimensional solution: the scene is empty");
    }
    return {};
  }
  [[nodiscard]] std::size_t part_of(const scene::Instance& instance) const {
    return static_cast<std::size_t>(&instance - geometry_.instances.data());
  }

  /// Finds the ground: an instance whose faces all look up from one height.
  void find_ground() {
    std::vector<char> sheet(geometry_.instances.size(), 1);
    std::vector<double> height(geometry_.instances.size(), std::nan(""));
    for (std::size_t i = 0; i < triangles_.size(); ++i) {
      const Triangle& t = triangles_[i];
      double& z = height[part_[i]];
      if (std::isnan(z)) z = t.p_m[0].z;
      if (t.axis != 2 || t.sign < 0 || std::abs(t.p_m[0].z - z) > kMergeM) sheet[part_[i]] = 0;
    }
    for (std::size_t i = 0; i < triangles_.size(); ++i) triangles_[i].ground = sheet[part_[i]] != 0;
  }

  /// Collects the planes of each axis and the height of the ground.
  Result<void> find_planes() {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::vector<double> all;
      for (const Triangle& t : triangles_) {
        for (const glm::dvec3& p : t.p_m) {
          // Take every vertex. Planes inside a face do no harm: they only refine the feature grid.
          all.push_back(p[at(axis)]);
        }
      }
      std::sort(all.begin(), all.end());
      std::vector<double>& planes = shape_.planes_m[axis];
      for (const double x : all) {
        // Round to a micrometre, which removes the error of float32, and merge planes that are
        // equal.
        const double rounded = std::round(x * 1e6) * 1e-6;
        if (planes.empty() || rounded > planes.back() + kMergeM) planes.push_back(rounded);
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
    for (const Triangle& t : triangles_) {
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

  /// Returns the index of the plane at x.
  [[nodiscard]] std::size_t plane(std::size_t axis, double x) const {
    const std::vector<double>& planes = shape_.planes_m[axis];
    const auto after = std::lower_bound(planes.begin(), planes.end(), x - kMergeM);
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
    for (const Triangle& t : triangles_) {
      const std::size_t u = (t.axis + 1) % 3;
      const std::size_t v = (t.axis + 2) % 3;
      std::array<std::size_t, 3> cell{};
      cell[t.axis] = plane(t.axis, t.p_m[0][at(t.axis)]);
      // Visit the rectangles within the bounds of the triangle.
      const auto range = [&](std::size_t axis) {
        const auto [low, high] =
            std::minmax({t.p_m[0][at(axis)], t.p_m[1][at(axis)], t.p_m[2][at(axis)]});
        return std::pair(plane(axis, low), plane(axis, high));
      };
      const auto [u0, u1] = range(u);
      const auto [v0, v1] = range(v);
      for (cell[u] = u0; cell[u] < u1; ++cell[u]) {
        for (cell[v] = v0; cell[v] < v1; ++cell[v]) {
          if (!inside(t, u, v, middle(u, cell[u]), middle(v, cell[v]))) continue;
          if (t.ground) {
            shape_.ground[cell[0] + shape_.count(0) * cell[1]] = t.material;
          } else {
            Cover& cover = faces_[t.axis][face_index(t.axis, cell)];
            (t.sign > 0 ? cover.up : cover.down) = true;
            cover.material = t.material;
            cover.object = t.object;
          }
        }
      }
    }
  }
  /// Returns the middle of a cell along an axis.
  [[nodiscard]] double middle(std::size_t axis, std::size_t cell) const {
    return 0.5 * (shape_.planes_m[axis][cell] + shape_.planes_m[axis][cell + 1]);
  }
  /// Returns the index of a rectangle across an axis.
  [[nodiscard]] std::size_t face_index(std::size_t axis,
                                       const std::array<std::size_t, 3>& cell) const {
    std::array<std::size_t, 3> n{shape_.count(0), shape_.count(1), shape_.count(2)};
    ++n[axis];
    return cell[0] + n[0] * (cell[1] + n[1] * cell[2]);
  }
  /// Returns true if a triangle contains the point (x, y) of its plane.
  static bool inside(const Triangle& t, std::size_t u, std::size_t v, double x, double y) {
    double least = 0.0;
    double greatest = 0.0;
    for (std::size_t c = 0; c < 3; ++c) {
      const glm::dvec3& a = t.p_m[c];
      const glm::dvec3& b = t.p_m[(c + 1) % 3];
      const double side =
          (b[at(u)] - a[at(u)]) * (y - a[at(v)]) - (b[at(v)] - a[at(v)]) * (x - a[at(u)]);
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
        visit(axis, step, faces_[axis][face_index(axis, face)], outside, next);
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
                           object = cover.object;
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
                         object = cover.object;
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

  /// Gives every solid the material of its faces, which must be a single one.
  Result<void> give_materials() {
    const std::size_t cells = shape_.fill.size();
    constexpr std::uint32_t kNone = 0xffffffffU;
    shape_.material.assign(cells, kNone);
    std::vector<char> seen(cells, 0);
    for (std::size_t k = 0; k < shape_.count(2); ++k) {
      for (std::size_t j = 0; j < shape_.count(1); ++j) {
        for (std::size_t i = 0; i < shape_.count(0); ++i) {
          if (shape_.fill[shape_.index(i, j, k)] != ShapeFill::solid || seen[shape_.index(i, j, k)])
            continue;
          // Gather the connected cells of the solid and the materials of all its faces.
          std::vector<std::array<std::size_t, 3>> body{{i, j, k}};
          seen[shape_.index(i, j, k)] = 1;
          std::uint32_t material = kNone;
          std::uint32_t object = 0;
          bool mixed = false;
          for (std::size_t b = 0; b < body.size(); ++b) {
            const auto cell = body[b];
            for_neighbours(
                cell, [&](std::size_t, int, const Cover& cover, bool outside, const auto& next) {
                  if (cover.up || cover.down) {
                    mixed |= material != kNone && material != cover.material;
                    material = cover.material;
                    object = cover.object;
                    return;
                  }
                  const std::size_t other = shape_.index(next[0], next[1], next[2]);
                  if (outside || seen[other] || shape_.fill[other] != ShapeFill::solid) return;
                  seen[other] = 1;
                  body.push_back(next);
                });
          }
          if (mixed) return refuse(object, "one body shows several materials");
          for (const auto& cell : body) {
            shape_.material[shape_.index(cell[0], cell[1], cell[2])] = material;
          }
        }
      }
    }
    return {};
  }

  struct Cover {
    bool up = false;    ///< the face's outside lies towards greater coordinates
    bool down = false;  ///< the face's outside lies towards smaller coordinates
    std::uint32_t material = 0;
    std::uint32_t object = 0;
  };

  const scene::ScenarioDesc& scenario_;
  const scene::SceneGeometry& geometry_;
  VoxelShape shape_;
  std::vector<Triangle> triangles_;
  std::vector<std::size_t> part_;  ///< instance of every triangle
  std::array<std::vector<Cover>, 3> faces_;
};

}  // namespace

Result<VoxelShape> voxel_shape(const scene::ScenarioDesc& scenario,
                               const scene::SceneGeometry& geometry) {
  return ShapeBuilder(scenario, geometry).build();
}

}  // namespace emit::reference
