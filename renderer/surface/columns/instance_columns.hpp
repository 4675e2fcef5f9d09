// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "surface/columns/surface_columns.hpp"
#include "surface/model/surface_model.hpp"

/// Columns of one instance and what finds them. Only link_columns() needs them.
namespace emit::renderer::columns {

using physics::ColumnCells;
using physics::kMaxColumnCells;
using Cells = physics::CellState<double>;

/// Distance from a crease within which samples have columns, in thicknesses of their stack.
inline constexpr double kReachThicknesses = 2.0;
/// Greatest such distance, in m.
inline constexpr double kMaxReachM = 1.0;
/// Points per side of the part of a triangle that belongs to a corner, at which its cells are
/// measured.
inline constexpr std::size_t kPoints = 3;
/// Distance of a cell from the plane between two faces, in thicknesses of the cell at least.
inline constexpr double kLeastThickness = 0.1;
/// Share of half of a body's thickness that the stacks of both faces have to reach at least. Stacks
/// that end just before the middle touch there.
inline constexpr double kReachedFrac = 0.98;
/// Distance, in ray offsets, that counts as touching: ground touches a body if it lies this close
/// beside it, and this close to the plane of its face.
inline constexpr float kBesideOffsets = 6.0F;
inline constexpr std::uint32_t kNone = 0xffffffffU;

/// Piece of an edge between two faces that meet at an angle, seen from one of them.
struct Crease {
  glm::dvec3 begin_m{0.0};
  glm::dvec3 end_m{0.0};
  glm::dvec3 inward{0.0};   ///< unit length, in the face, away from the edge
  glm::dvec3 across{0.0};   ///< the same on the other face
  glm::dvec3 between{0.0};  ///< unit normal of the plane that halves the angle between the faces
  std::array<std::uint32_t, 2> own{};    ///< vertices at begin and end, on this face
  std::array<std::uint32_t, 2> other{};  ///< and on the other one
  std::uint32_t other_slot = 0;          ///< leaf on the other face
  /// Distance from the edge per depth at which the other face takes over. At a concave edge it is
  /// negative: the material goes on behind the edge.
  double slant = 0.0;
  bool stands = false;  ///< the face stands on ground there
};
/// Foot of a wall: a crease to a face that stands on ground, and the ground beside it.
struct Foot {
  std::uint32_t crease = 0;
  CasterHit ground;
};
/// Crease near a vertex.
struct Near {
  std::uint32_t crease = 0;
  double distance_m = 0.0;
};
/// Creases near a vertex, each in another direction.
struct Neighbourhood {
  static constexpr std::size_t kMost = 4;
  std::array<Near, kMost> near{};
  std::size_t count = 0;
};
/// Depth at which the material below a point of a face ends, because another face takes over.
struct End {
  double depth_m = 1e9;
  std::uint32_t crease = kNone;
  double distance_m = 0.0;
};

/// Face on the other side of a solid that is so thin there that both stacks reach its middle.
struct Opposite {
  double depth_m = 1e9;        ///< half of the solid's thickness: the material below ends there
  std::uint32_t slot = kNone;  ///< leaf on the other face
};
/// Distance from a crease that goes on by `beyond_m` at both ends.
[[nodiscard]] double distance_m(const Crease& crease, const glm::dvec3& at_m,
                                double beyond_m = 0.0);

/// Conductance between two cells. Cells count kMaxColumnCells to a column.
struct Pair {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  double conductance_w_k = 0.0;
};

/// Joins conductances between the same cells.
void join_pairs(std::vector<Pair>& pairs);

/// Columns of the samples of one instance.
class InstanceColumns {
 public:
  using FootVisit = std::function<void(std::uint32_t own, std::uint32_t ground, std::uint32_t under,
                                       double conductance_w_k)>;

  InstanceColumns(const SurfaceInputs& inputs, const SurfaceModel& model, std::uint32_t instance);
  /// Finds columns and pairs.
  void find();
  [[nodiscard]] std::span<const Pair> pairs() const noexcept { return pairs_; }
  /// Vertices that have a column, ascending.
  [[nodiscard]] std::span<const std::uint32_t> vertices() const noexcept { return vertices_; }
  [[nodiscard]] double area_m2(std::size_t column) const noexcept {
    return measured_[column].area_m2;
  }
  [[nodiscard]] double exposed_frac(std::size_t column) const noexcept {
    return measured_[column].exposed_m2 / measured_[column].area_m2;
  }
  /// Returns the share of the difference between the surface and its first cell that is left beside
  /// a foot (SurfaceSample::excess_frac): that of a half space above a depth if the flux into its
  /// face ends there.
  [[nodiscard]] double excess_frac(std::size_t column) const;
  /// Returns true if a solid stands on the instance.
  [[nodiscard]] bool any_at_foot() const {
    return std::ranges::any_of(vertices_, [&](std::uint32_t v) { return at_foot(v); });
  }
  /// Vertices of faces that stand on ground. They have no columns: the wall above them owns the
  /// material down to the ground.
  [[nodiscard]] std::span<const std::uint32_t> standing() const noexcept { return standing_; }
  /// Links the cells at the feet of walls with the ground under them, which is among `all`. Visits
  /// visit(own cell, ground's instance, cell there, conductance_w_k).
  void each_foot(std::span<const InstanceColumns> all, const FootVisit& visit) const;
  /// Returns a column without links.
  [[nodiscard]] SampleColumn column(std::size_t index) const;

 private:
  /// One side of an edge of the welded mesh.
  struct Side {
    std::uint32_t low = 0;  ///< welded vertices at its ends
    std::uint32_t high = 0;
    std::uint32_t half_edge = 0;  ///< 3 slot + corner that it starts from
    std::uint32_t at_low = 0;     ///< own vertices there
    std::uint32_t at_high = 0;
    [[nodiscard]] std::uint32_t slot() const noexcept { return half_edge / 3; }
  };
  /// Measures of the column of a vertex.
  struct Measured {
    double area_m2 = 0.0;
    double exposed_m2 = 0.0;  ///< part of it that takes up flux (SurfaceSample::exposed_frac)
    Cells held_m2{};          ///< volume of each cell per thickness
    Cells below_w_k{};        ///< conductance to the next one, or to the base
    std::array<glm::dvec3, kMaxColumnCells> middle_m{};  ///< sum, then mean, over its volume
  };

  [[nodiscard]] const std::array<std::uint32_t, 3>& leaf(std::uint32_t slot) const noexcept {
    return leaves_[slot];
  }
  [[nodiscard]] std::uint32_t leaf_count() const noexcept {
    return static_cast<std::uint32_t>(leaves_.size());
  }
  [[nodiscard]] const ColumnCells& cells(std::uint32_t vertex) const {
    return heat_.cells(samples_[vertex].material);
  }
  [[nodiscard]] bool conducts(std::uint32_t vertex) const {
    return samples_[vertex].other_side == kNoSample && cells(vertex).count != 0;
  }
  [[nodiscard]] double thickness_m(std::uint32_t vertex) const {
    const ColumnCells& own = cells(vertex);
    return own.top_m[own.count];
  }
  [[nodiscard]] double reach_m(std::uint32_t vertex) const {
    return std::min(kMaxReachM, kReachThicknesses * thickness_m(vertex));
  }
  /// Returns true beside or under a solid that stands on the surface.
  [[nodiscard]] bool at_foot(std::uint32_t vertex) const {
    return conducts(vertex) &&
           samples_[vertex].foot_m < foot_reach_m(in_.materials[samples_[vertex].material]);
  }
  [[nodiscard]] glm::dvec3 area_vector_m2(std::uint32_t slot) const {
    const auto& leaf = this->leaf(slot);
    return 0.5 *
           glm::cross(place_m_[leaf[1]] - place_m_[leaf[0]], place_m_[leaf[2]] - place_m_[leaf[0]]);
  }
  [[nodiscard]] glm::dvec3 normal(std::uint32_t slot) const {
    const glm::dvec3 area_m2 = area_vector_m2(slot);
    const double length = glm::length(area_m2);
    return length > 0.0 ? area_m2 / length : glm::dvec3(0.0);
  }
  [[nodiscard]] glm::dvec3 centre_m(std::uint32_t slot) const {
    const auto& leaf = this->leaf(slot);
    return (place_m_[leaf[0]] + place_m_[leaf[1]] + place_m_[leaf[2]]) / 3.0;
  }
  /// Returns the unit direction from an edge into a leaf.
  [[nodiscard]] glm::dvec3 inward(const Side& side) const;
  /// Returns true for a face in a closed cavity of the body: no ray from it leaves the body's box.
  [[nodiscard]] bool closed_in(const SurfaceSample& sample) const;
  /// Returns the geometry that surrounds the instance at its own place. Spans of it point into the
  /// instance.
  [[nodiscard]] CasterSelection around() const noexcept { return {alone_.empty(), alone_}; }
  /// Returns the depth below a vertex of a wall up to which the material belongs to it: half of the
  /// way to the other face of the body, unless that one lies in a closed cavity.
  [[nodiscard]] double depth_m(std::uint32_t vertex, std::span<const InstanceColumns> all) const;
  /// Returns the ground on which the face at `beside`'s other side, with that outward normal,
  /// stands, if it does. Ground shows beside the body, in the plane of that face.
  [[nodiscard]] std::optional<CasterHit> ground_of(std::uint32_t beside,
                                                   const glm::dvec3& face) const;
  /// Returns true if a place of the face of `beside` lies under a solid: the first face above it is
  /// seen from behind.
  [[nodiscard]] bool under_a_solid(const glm::dvec3& at_m, std::uint32_t beside) const;
  /// Finds the creases between faces that conduct, the neighbours of every leaf on its face, and
  /// vertices that share a place without a crease.
  void find_creases();
  /// Notes an edge between two leaves.
  void join(const Side& one, const Side& other);
  /// Notes the end of a face if it stands on ground there. The face below it may be missing or have
  /// other edges.
  void end_at(const Side& side);
  /// Adds a crease to those near a vertex, unless one in the same direction is as near.
  void offer(std::uint32_t vertex, std::uint32_t crease);
  /// Spreads the creases over the vertices within reach, from neighbour to neighbour.
  void spread_creases();
  /// Returns true near the edge of a face that stands on ground.
  [[nodiscard]] bool stands_near(std::uint32_t vertex) const;
  /// Finds the opposite faces of thin solids.
  void find_opposites();
  /// Gives a column to the vertices near creases and feet, and to those of thin solids.
  void find_near();
  /// Exchanges edges between leaves of a plane that have columns, until they are Delaunay
  /// triangles: with those no face between two columns has a negative width, however narrow the
  /// triangles are that the mesh has.
  void make_delaunay();
  /// Returns the half-edge of a leaf that runs from the place of one vertex to that of another;
  /// kNone if it has none.
  [[nodiscard]] std::uint32_t half_edge(std::uint32_t slot, std::uint32_t from,
                                        std::uint32_t to) const;
  /// Exchanges the edge of two leaves for the other diagonal if their angles on both sides of it
  /// add up to more than 180 degrees. `open` receives the edges around them.
  void flip(std::uint32_t edge, std::vector<std::uint32_t>& open);

  [[nodiscard]] bool any_column(const std::array<std::uint32_t, 3>& leaf) const {
    return std::ranges::any_of(leaf, [&](std::uint32_t v) { return column_of_[v] != kNone; });
  }
  /// Returns where the material below a point of a leaf ends.
  [[nodiscard]] End end_below(const std::array<std::uint32_t, 3>& leaf,
                              const glm::dvec3& at_m) const;
  /// Visits points of the part of a leaf that belongs to its corner k: visit(place_m, area_m2).
  template <class Visit>
  void each_point(std::uint32_t slot, std::size_t k, const Visit& visit) const {
    const auto& leaf = this->leaf(slot);
    const glm::dvec3& corner_m = place_m_[leaf[k]];
    const glm::dvec3 one_m = 0.5 * (place_m_[leaf[(k + 1) % 3]] - corner_m);
    const glm::dvec3 two_m = 0.5 * (place_m_[leaf[(k + 2) % 3]] - corner_m);
    // The part is a quadrangle: the corner, the middles of two edges, and the centre. The centre
    // lies at 2/3 of one_m + two_m. The area of a small part of it shrinks linearly towards there.
    const double area_m2 = glm::length(area_vector_m2(slot)) / 3.0;
    std::array<double, kPoints * kPoints> weight{};
    double sum = 0.0;
    const auto way = [](std::size_t i) { return (static_cast<double>(i) + 0.5) / kPoints; };
    for (std::size_t i = 0; i < kPoints; ++i) {
      for (std::size_t j = 0; j < kPoints; ++j) {
        weight[i * kPoints + j] = 1.0 - (way(i) + way(j)) / 3.0;
        sum += weight[i * kPoints + j];
      }
    }
    for (std::size_t i = 0; i < kPoints; ++i) {
      for (std::size_t j = 0; j < kPoints; ++j) {
        const double s = way(i);
        const double t = way(j);
        const glm::dvec3 at_m = corner_m + (s - s * t / 3.0) * one_m + (t - s * t / 3.0) * two_m;
        visit(at_m, area_m2 * weight[i * kPoints + j] / sum);
      }
    }
  }
  /// Share of a cell, between the depths `top_m` and `bottom_m`, that lies above `end_m`.
  [[nodiscard]] static double share_above(double top_m, double bottom_m, double end_m) noexcept {
    return std::clamp((end_m - top_m) / (bottom_m - top_m), 0.0, 1.0);
  }
  /// Returns the share of the material behind a concave crease that belongs to the column of its
  /// vertex `e`, between two depths: near an end of the crease other faces take over.
  [[nodiscard]] double share_behind(const Crease& crease, std::size_t e, double top_m,
                                    double bottom_m) const;
  /// Returns the last cell above a depth.
  [[nodiscard]] static std::size_t cell_above(const ColumnCells& stack, double end_m) noexcept {
    constexpr double kJustAbove = 1.0 - 1e-6;
    return stack.at(kJustAbove * end_m);
  }
  /// Returns the conductance from the middle of a cell to that of the next one, or to the base,
  /// W m-2 K-1, under a point where a crease ends the material at one depth and the opposite face
  /// at another.
  [[nodiscard]] static double below_w_m2_k(const ColumnCells& stack, std::size_t l, double crease_m,
                                           double opposite_m) noexcept;
  /// Gives what lies open of a leaf to its open corners.
  void expose(std::uint32_t slot);
  /// Measures volumes, areas and middles of all cells.
  void measure_cells();
  /// Adds a conductance between cells.
  void add(std::uint32_t a, std::size_t l, std::uint32_t b, std::size_t m, double conductance_w_k);
  /// Visits the pairs of cells of two columns that lie side by side: visit(l, m, thickness_m).
  template <class Visit>
  void each_beside(std::uint32_t a, std::uint32_t b, const Visit& visit) const {
    const ColumnCells& one = cells(a);
    const ColumnCells& other = cells(b);
    if (samples_[a].material == samples_[b].material) {
      for (std::size_t l = 0; l < one.count; ++l) visit(l, l, one.thickness_m(l));
      return;
    }
    for (std::size_t l = 0; l < one.count; ++l) {
      for (std::size_t m = 0; m < other.count; ++m) {
        const double both_m =
            std::min(one.top_m[l + 1], other.top_m[m + 1]) - std::max(one.top_m[l], other.top_m[m]);
        if (both_m > 0.0) visit(l, m, both_m);
      }
    }
  }
  [[nodiscard]] const glm::dvec3& middle_m(std::uint32_t vertex, std::size_t l) const {
    return measured_[column_of_[vertex]].middle_m[l];
  }
  /// Links columns whose samples are neighbours on a face.
  void link_along();
  /// Returns the leaf that holds a point of a face, walking from `slot`; kNone if the walk leaves
  /// the face. `weight` receives the shares of its corners.
  [[nodiscard]] std::uint32_t locate(std::uint32_t slot, const glm::dvec3& at_m,
                                     std::array<double, 3>& weight) const;
  /// Adds half of the conductance between a cell and one across a crease, whose plane it meets over
  /// an area. The other half comes from the other side.
  void add_across(const Crease& crease, std::uint32_t a, std::size_t l, std::uint32_t b,
                  std::size_t m, double area_m2);
  /// Links columns that meet in the plane that halves the angle of a crease, and those of opposite
  /// faces.
  void link_across();
  /// Links a point of a leaf that belongs to vertex `a` with the opposite face.
  void add_through(std::uint32_t a, std::uint32_t slot, const glm::dvec3& at_m, double area_m2);
  /// Links columns at one place on faces without a crease between them.
  void link_seams();

  const SurfaceInputs& in_;
  std::vector<EntityPlacement> alone_;  ///< places an entity alone, in its body's axes
  glm::dvec3 low_m_{1e9};               ///< box around the vertices, in the axes of the samples
  glm::dvec3 high_m_{-1e9};
  std::uint32_t instance_;
  std::uint32_t object_;
  const FosterHeat& heat_;
  const RefinedMesh& mesh_;
  std::span<const SurfaceSample> samples_;
  std::vector<glm::dvec3> place_m_;                   ///< by vertex, in the axes of the samples
  std::vector<std::array<std::uint32_t, 3>> leaves_;  ///< vertices, by slot of the mesh
  std::vector<Crease> creases_;
  std::vector<std::uint32_t> beside_;  ///< by half-edge: the leaf beyond it on the same face
  std::vector<std::pair<std::uint32_t, std::uint32_t>> seams_;
  std::vector<Neighbourhood> near_;  ///< by vertex
  std::vector<Opposite> opposite_;   ///< by vertex
  std::vector<Foot> feet_;
  std::vector<std::uint32_t> standing_;
  std::deque<std::uint32_t> waiting_;
  std::vector<std::uint32_t> column_of_;  ///< by vertex
  std::vector<std::uint32_t> vertices_;   ///< by column
  std::vector<Measured> measured_;        ///< by column
  std::vector<Pair> pairs_;
};

}  // namespace emit::renderer::columns
