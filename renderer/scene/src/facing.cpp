// SPDX-License-Identifier: Apache-2.0
#include "facing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

namespace emit::scene {
namespace {

/// Vertices are one when they agree to this share of the model's size.
constexpr double kMergeFrac = 1e-7;
/// Contradictions on a smaller share of a surface are slivers with smooth normals.
constexpr double kMinContradictionFrac = 1e-3;
/// A surface is ground when its level part, as one area vector, has this share of its area.
constexpr double kMinLevelFrac = 0.7;
/// Volume over area^1.5 that an open surface must span to have an outside. A cube without a floor
/// has 0.09, a gently curved sheet less than 0.01.
constexpr double kMinOpenVolume = 0.01;
constexpr double kMinClosedVolume = 1e-9;
/// Ground that faces down is worth a warning when it covers this share of the model's plan.
constexpr double kMinGroundFrac = 0.25;

struct Triangle {
  std::uint32_t mesh = 0;
  std::uint32_t first_index = 0;
  std::array<std::uint32_t, 3> corner{};  ///< numbers of merged vertices
  glm::dvec3 area_m2{0.0};                ///< by winding, in the axes of the model
  float sign = 0.0F;  ///< +1 or -1: winding as that of its surface's first triangle, or not
  bool contradicts = false;
};

struct Edge {
  std::uint64_t corners = 0;  ///< lower number first
  std::uint32_t triangle = 0;
  bool forward = false;  ///< the triangle runs from the lower to the higher number
};

struct Surface {
  std::vector<std::uint32_t> triangles;
  double area_m2 = 0.0;
  double contradiction_m2 = 0.0;
  double volume_m3 = 0.0;  ///< by sign; about the middle of the rim
  double volume_by_winding_m3 = 0.0;
  glm::dvec3 signed_area_m2{0.0};  ///< area vectors added up by sign
  glm::dvec3 winding_area_m2{0.0};
  double majority_m2 = 0.0;  ///< area with sign +1 less area with sign -1
  Aabb bounds;
  bool closed = true;
  bool double_sided = false;
};

class Facing {
 public:
  explicit Facing(GltfModel& model) : model_(model), changes_(model.meshes.size()) {}

  void run() {
    collect();
    if (triangles_.empty()) return;
    link();
    split_into_surfaces();
    for (Surface& surface : surfaces_) {
      if (surface.contradiction_m2 > kMinContradictionFrac * surface.area_m2) mend(surface);
    }
    turn_normals();
    report_changes();
    report_inward_bodies();
    report_ground_from_below();
  }

 private:
  struct Change {
    std::uint32_t triangles = 0;  ///< that contradicted their normals
    std::uint32_t wound = 0;      ///< whose winding was turned
    std::uint32_t normals = 0;    ///< vertices whose normal was turned
    bool touched = false;
  };

  /// Triangles of each mesh under its first placement. Other placements show the same mesh.
  void collect() {
    placement_of_.assign(model_.meshes.size(), nullptr);
    for (const GltfPlacement& placement : model_.placements) {
      if (placement_of_[placement.mesh] == nullptr) placement_of_[placement.mesh] = &placement;
    }
    for (std::uint32_t m = 0; m < model_.meshes.size(); ++m) {
      if (placement_of_[m] == nullptr) continue;
      const Mesh& mesh = model_.meshes[m];
      const auto base = static_cast<std::uint32_t>(points_m_.size());
      for (const glm::vec3& position : mesh.positions_m) {
        points_m_.emplace_back(placement_of_[m]->gltf_from_mesh *
                               glm::dvec4(glm::dvec3(position), 1.0));
      }
      for (std::uint32_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
        Triangle triangle;
        triangle.mesh = m;
        triangle.first_index = i;
        for (std::uint32_t k = 0; k < 3; ++k) {
          triangle.corner[k] = base + mesh.indices[i + k];
          bounds_.add(points_m_[triangle.corner[k]]);
        }
        const glm::dvec3& a = points_m_[triangle.corner[0]];
        triangle.area_m2 =
            0.5 * glm::cross(points_m_[triangle.corner[1]] - a, points_m_[triangle.corner[2]] - a);
        triangle.contradicts = contradicts(mesh, i);
        triangles_.push_back(triangle);
      }
    }
    merge_points();
  }

  /// True where all three normals look to the back of the triangle.
  static bool contradicts(const Mesh& mesh, std::uint32_t first_index) {
    const glm::dvec3 area = area_in_mesh(mesh, first_index);
    for (std::uint32_t k = 0; k < 3; ++k) {
      const glm::dvec3 normal(mesh.normals[mesh.indices[first_index + k]]);
      if (!(glm::dot(normal, area) < 0.0)) return false;
    }
    return true;
  }

  static glm::dvec3 area_in_mesh(const Mesh& mesh, std::uint32_t first_index) {
    const glm::dvec3 a(mesh.positions_m[mesh.indices[first_index]]);
    const glm::dvec3 b(mesh.positions_m[mesh.indices[first_index + 1]]);
    const glm::dvec3 c(mesh.positions_m[mesh.indices[first_index + 2]]);
    return 0.5 * glm::cross(b - a, c - a);
  }

  /// Gives corners at one place one number.
  void merge_points() {
    const glm::dvec3 size = bounds_.empty() ? glm::dvec3(0.0) : bounds_.max_m - bounds_.min_m;
    const double cell_m = std::max(kMergeFrac * std::max({size.x, size.y, size.z}), 1e-12);
    std::vector<std::pair<std::array<std::int64_t, 3>, std::uint32_t>> cells(points_m_.size());
    for (std::uint32_t p = 0; p < points_m_.size(); ++p) {
      const glm::dvec3 place = (points_m_[p] - bounds_.min_m) / cell_m;
      for (int axis = 0; axis < 3; ++axis) {
        // Vertices without a triangle may lie anywhere.
        const double clamped = std::clamp(place[axis], -1e15, 1e15);
        cells[p].first[static_cast<std::size_t>(axis)] = std::llround(clamped);
      }
      cells[p].second = p;
    }
    std::ranges::sort(cells);
    std::vector<std::uint32_t> number(points_m_.size());
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const bool is_new = i == 0 || cells[i].first != cells[i - 1].first;
      number[cells[i].second] = is_new ? cells[i].second : number[cells[i - 1].second];
    }
    for (Triangle& triangle : triangles_) {
      for (std::uint32_t& corner : triangle.corner) corner = number[corner];
    }
  }

  /// Finds the edges that exactly two triangles share, and those that one has alone.
  void link() {
    edges_.reserve(3 * triangles_.size());
    for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t from = triangles_[t].corner[k];
        const std::uint32_t to = triangles_[t].corner[(k + 1) % 3];
        if (from == to) continue;
        const std::uint64_t low = std::min(from, to);
        edges_.push_back({low << 32U | std::max(from, to), t, from < to});
      }
    }
    std::ranges::sort(edges_, {}, &Edge::corners);
    neighbours_.assign(triangles_.size(), {});
    for (std::size_t i = 0, next = 0; i < edges_.size(); i = next) {
      next = i + 1;
      while (next < edges_.size() && edges_[next].corners == edges_[i].corners) ++next;
      if (next - i == 1) rim_.push_back(edges_[i]);
      if (next - i == 2) {
        const Edge& a = edges_[i];
        const Edge& b = edges_[i + 1];
        add_neighbour(a.triangle, b.triangle, a.forward != b.forward);
        add_neighbour(b.triangle, a.triangle, a.forward != b.forward);
      }
    }
  }

  struct Neighbour {
    std::uint32_t triangle = std::numeric_limits<std::uint32_t>::max();
    bool agrees = true;  ///< both windings go around the same side
  };

  void add_neighbour(std::uint32_t of, std::uint32_t triangle, bool agrees) {
    for (Neighbour& place : neighbours_[of]) {
      if (place.triangle != std::numeric_limits<std::uint32_t>::max()) continue;
      place = {triangle, agrees};
      return;
    }
  }

  /// Walks over shared edges and gives each triangle its sign against the first one.
  void split_into_surfaces() {
    std::vector<std::uint32_t> surface_of(triangles_.size(), 0);
    for (std::uint32_t first = 0; first < triangles_.size(); ++first) {
      if (triangles_[first].sign != 0.0F) continue;
      Surface surface;
      triangles_[first].sign = 1.0F;
      surface.triangles.push_back(first);
      for (std::size_t next = 0; next < surface.triangles.size(); ++next) {
        const std::uint32_t t = surface.triangles[next];
        surface_of[t] = static_cast<std::uint32_t>(surfaces_.size());
        for (const Neighbour& neighbour : neighbours_[t]) {
          if (neighbour.triangle >= triangles_.size()) continue;
          Triangle& other = triangles_[neighbour.triangle];
          if (other.sign != 0.0F) continue;
          other.sign = neighbour.agrees ? triangles_[t].sign : -triangles_[t].sign;
          surface.triangles.push_back(neighbour.triangle);
        }
      }
      surfaces_.push_back(std::move(surface));
    }
    std::vector<glm::dvec3> rim_sum_m(surfaces_.size(), glm::dvec3(0.0));
    std::vector<double> rim_edges(surfaces_.size(), 0.0);
    for (const Edge& edge : rim_) {
      const std::uint32_t s = surface_of[edge.triangle];
      surfaces_[s].closed = false;
      rim_sum_m[s] +=
          points_m_[edge.corners >> 32U] + points_m_[static_cast<std::uint32_t>(edge.corners)];
      rim_edges[s] += 2.0;
    }
    for (std::size_t s = 0; s < surfaces_.size(); ++s) {
      measure(surfaces_[s], rim_edges[s] > 0.0
                                ? rim_sum_m[s] / rim_edges[s]
                                : points_m_[triangles_[surfaces_[s].triangles.front()].corner[0]]);
    }
  }

  /// @param middle_m  a cone from the rim to here closes an open surface without adding volume when
  ///                  the rim is flat
  void measure(Surface& surface, const glm::dvec3& middle_m) {
    for (const std::uint32_t t : surface.triangles) {
      const Triangle& triangle = triangles_[t];
      const double area_m2 = glm::length(triangle.area_m2);
      const double sign = static_cast<double>(triangle.sign);
      const double cone_m3 =
          glm::dot(points_m_[triangle.corner[0]] - middle_m, triangle.area_m2) / 3.0;
      surface.area_m2 += area_m2;
      surface.volume_m3 += sign * cone_m3;
      surface.volume_by_winding_m3 += cone_m3;
      surface.signed_area_m2 += sign * triangle.area_m2;
      surface.winding_area_m2 += triangle.area_m2;
      surface.majority_m2 += sign * area_m2;
      if (triangle.contradicts) surface.contradiction_m2 += area_m2;
      for (const std::uint32_t corner : triangle.corner) surface.bounds.add(points_m_[corner]);
      surface.double_sided = surface.double_sided || is_double_sided(triangle);
    }
  }

  [[nodiscard]] bool is_double_sided(const Triangle& triangle) const {
    for (const Submesh& submesh : model_.meshes[triangle.mesh].submeshes) {
      if (triangle.first_index - submesh.first_index < submesh.index_count) {
        return submesh.double_sided;
      }
    }
    return false;
  }

  /// +1 or -1: the sign of triangles whose winding is right.
  static double outside(const Surface& surface) {
    const double level_m2 = surface.signed_area_m2.y;
    if (!surface.closed && std::abs(level_m2) >= kMinLevelFrac * surface.area_m2) {
      return level_m2 > 0.0 ? 1.0 : -1.0;
    }
    const double least = (surface.closed ? kMinClosedVolume : kMinOpenVolume) * surface.area_m2 *
                         std::sqrt(surface.area_m2);
    if (std::abs(surface.volume_m3) > least) return surface.volume_m3 > 0.0 ? 1.0 : -1.0;
    return surface.majority_m2 >= 0.0 ? 1.0 : -1.0;
  }

  void mend(const Surface& surface) {
    const double right = outside(surface);
    for (const std::uint32_t t : surface.triangles) {
      Triangle& triangle = triangles_[t];
      Change& change = changes_[triangle.mesh];
      change.touched = true;
      if (triangle.contradicts) ++change.triangles;
      if (static_cast<double>(triangle.sign) == right) continue;
      std::vector<std::uint32_t>& indices = model_.meshes[triangle.mesh].indices;
      std::swap(indices[triangle.first_index + 1], indices[triangle.first_index + 2]);
      triangle.area_m2 = -triangle.area_m2;
      ++change.wound;
    }
  }

  /// Turns the normals of changed meshes to the side to which their triangles look.
  void turn_normals() {
    for (std::uint32_t m = 0; m < model_.meshes.size(); ++m) {
      if (!changes_[m].touched) continue;
      Mesh& mesh = model_.meshes[m];
      std::vector<double> sum(mesh.normals.size(), 0.0);
      for (std::uint32_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
        const glm::dvec3 area = area_in_mesh(mesh, i);
        for (std::uint32_t k = 0; k < 3; ++k) {
          const std::uint32_t v = mesh.indices[i + k];
          sum[v] += glm::dot(glm::dvec3(mesh.normals[v]), area);
        }
      }
      for (std::size_t v = 0; v < sum.size(); ++v) {
        if (!(sum[v] < 0.0)) continue;
        mesh.normals[v] = -mesh.normals[v];
        ++changes_[m].normals;
      }
      update_bounds(mesh);
    }
  }

  [[nodiscard]] std::string name_of(std::uint32_t mesh) const {
    return fmt::format("{}: node '{}': mesh '{}'", model_.file.filename().string(),
                       placement_of_[mesh]->node, model_.meshes[mesh].name);
  }

  void report_changes() {
    for (std::uint32_t m = 0; m < changes_.size(); ++m) {
      const Change& change = changes_[m];
      if (change.wound + change.normals == 0) continue;
      model_.warnings.push_back(fmt::format(
          "{}: {} of {} triangles have normals against their winding; the geometry decides: the "
          "winding of {} triangles and {} normals are turned",
          name_of(m), change.triangles, model_.meshes[m].indices.size() / 3, change.wound,
          change.normals));
    }
  }

  static bool holds(const Aabb& outer, const Aabb& inner) {
    for (int axis = 0; axis < 3; ++axis) {
      if (outer.min_m[axis] > inner.min_m[axis] || outer.max_m[axis] < inner.max_m[axis]) {
        return false;
      }
    }
    return true;
  }

  static bool is_body(const Surface& surface) {
    return surface.closed && std::abs(surface.volume_by_winding_m3) >
                                 kMinClosedVolume * surface.area_m2 * std::sqrt(surface.area_m2);
  }

  [[nodiscard]] bool was_mended(const Surface& surface) const {
    return surface.contradiction_m2 > kMinContradictionFrac * surface.area_m2;
  }

  /// True for a surface with an outside that its fronts look to: a body, or one without a floor, as
  /// of a house that stands on the ground.
  static bool looks_outwards(const Surface& surface) {
    const double least = surface.closed ? kMinClosedVolume : kMinOpenVolume;
    return surface.volume_by_winding_m3 > least * surface.area_m2 * std::sqrt(surface.area_m2);
  }

  /// The inner skin of a hollow body looks inwards by right; a body on its own does not.
  void report_inward_bodies() {
    std::vector<const Surface*> outer;
    std::vector<const Surface*> inward;
    for (const Surface& surface : surfaces_) {
      if (surface.double_sided || was_mended(surface)) continue;
      if (looks_outwards(surface)) {
        outer.push_back(&surface);
      } else if (is_body(surface)) {
        inward.push_back(&surface);
      }
    }
    std::vector<std::uint32_t> count(model_.meshes.size(), 0);
    constexpr std::size_t kMaxCompared = 1000;
    for (std::size_t i = 0; i < std::min(inward.size(), kMaxCompared); ++i) {
      const bool is_skin = std::ranges::any_of(
          outer, [&](const Surface* other) { return holds(other->bounds, inward[i]->bounds); });
      if (is_skin) continue;
      for (const std::uint32_t t : inward[i]->triangles) ++count[triangles_[t].mesh];
    }
    for (std::uint32_t m = 0; m < count.size(); ++m) {
      if (count[m] == 0) continue;
      model_.warnings.push_back(
          fmt::format("{}: {} triangles bound a body whose fronts and normals all look inwards: it "
                      "is seen from inside only; turn its faces if it is not a room",
                      name_of(m), count[m]));
    }
  }

  void report_ground_from_below() {
    const glm::dvec3 size_m = bounds_.max_m - bounds_.min_m;
    const double plan_m2 = size_m.x * size_m.z;
    double up_m2 = 0.0;
    for (const Triangle& triangle : triangles_) {
      if (triangle.area_m2.y > 0.0 || is_double_sided(triangle))
        up_m2 += std::abs(triangle.area_m2.y);
    }
    for (const Surface& surface : surfaces_) {
      if (surface.closed || surface.double_sided || was_mended(surface)) continue;
      const double down_m2 = -surface.winding_area_m2.y;
      const double middle_m = 0.5 * (bounds_.min_m.y + bounds_.max_m.y);
      const bool is_ground =
          down_m2 >= kMinLevelFrac * surface.area_m2 && down_m2 >= kMinGroundFrac * plan_m2 &&
          surface.bounds.max_m.y <= middle_m + 1e-6 * size_m.y && up_m2 < 0.5 * down_m2;
      if (!is_ground) continue;
      model_.warnings.push_back(fmt::format(
          "{}: {} triangles face down, where ground would face up: they are not seen from above; "
          "turn their faces or set doubleSided",
          name_of(triangles_[surface.triangles.front()].mesh), surface.triangles.size()));
    }
  }

  GltfModel& model_;
  std::vector<Change> changes_;  ///< by mesh
  std::vector<const GltfPlacement*> placement_of_;
  std::vector<glm::dvec3> points_m_;  ///< vertices of all meshes, in the axes of the model
  Aabb bounds_;
  std::vector<Triangle> triangles_;
  std::vector<Edge> edges_;
  std::vector<Edge> rim_;
  std::vector<std::array<Neighbour, 3>> neighbours_;
  std::vector<Surface> surfaces_;
};

}  // namespace

void mend_facing(GltfModel& model) {
  Facing(model).run();
}

}  // namespace emit::scene
