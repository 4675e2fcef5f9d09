// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/surface_columns.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <optional>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/threads/parallel.hpp"
#include "surface/mesh/refined_mesh_edges.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer {
namespace {

using physics::ColumnCells;
using physics::kMaxColumnCells;
using Cells = physics::CellState<double>;

/// Cosine between the normals of two faces above which the edge between them is no crease: the
/// facets of a round side.
constexpr double kFlatCos = 0.9;
/// Distance from a crease within which samples have columns, in thicknesses of their stack.
constexpr double kReachThicknesses = 2.0;
/// Greatest such distance, in m.
constexpr double kMaxReachM = 1.0;
/// Greatest distance from the foot of a solid within which the surface beside and under it has
/// columns, in m: heat spreads over 0.4 m of soil or asphalt in three days.
constexpr double kFootReachM = 0.5;
/// Distance from a foot, in depths of the middle of the first cell, beyond which it does not change
/// the difference between the surface and that cell.
constexpr double kExcessDepths = 20.0;
/// Greatest distance from an edge per depth at which the other face takes over: that of an edge of
/// 40 degrees.
constexpr double kMaxSlant = 2.7;
/// Least share of a cell that a column keeps. Less is as good as nothing, and the cell remains part
/// of the balance.
constexpr double kLeastShare = 1e-3;
/// Points per side of the part of a triangle that belongs to a corner, at which its cells are
/// measured.
constexpr std::size_t kPoints = 3;
/// Distance of a cell from the plane between two faces, in thicknesses of the cell at least.
constexpr double kLeastThickness = 0.1;
/// Distance between samples at one place on faces without a crease, in widths of their columns.
constexpr double kSeamWays = 0.125;
/// Cosine between the directions away from two creases above which they are one edge.
constexpr double kSameCos = 0.9;
/// Cosine between the normals of two triangles above which they lie in one plane.
constexpr double kPlaneCos = 1.0 - 1e-6;
/// Sum of the cotangents of two angles, below 0, from which on an edge between them is exchanged.
constexpr double kLeastGain = 1e-6;
/// Exchanges of edges per edge after which the rest stays as it is.
constexpr std::size_t kMostFlips = 20;
/// Steps from triangle to triangle after which the search for a point across a crease gives up.
constexpr int kMostSteps = 400;
/// Distance, in ray offsets, that counts as touching: ground touches a body if it lies this close
/// beside it, and this close to the plane of its face.
constexpr float kBesideOffsets = 6.0F;
constexpr std::uint32_t kNone = 0xffffffffU;

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

/// Distance from a crease that goes on by `beyond_m` at both ends.
double distance_m(const Crease& crease, const glm::dvec3& at_m, double beyond_m = 0.0) {
  const glm::dvec3 way_m = crease.end_m - crease.begin_m;
  const double length_m = glm::length(way_m);
  const double along_m = glm::dot(at_m - crease.begin_m, way_m) / length_m;
  const double nearest_m = std::clamp(along_m, -beyond_m, length_m + beyond_m);
  return glm::distance(at_m, crease.begin_m + nearest_m / length_m * way_m);
}

/// Conductance between two cells. Cells count kMaxColumnCells to a column.
struct Pair {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  double conductance_w_k = 0.0;
};

/// Joins conductances between the same cells.
void join_pairs(std::vector<Pair>& pairs) {
  std::ranges::stable_sort(pairs, {}, [](const Pair& p) { return std::pair(p.a, p.b); });
  std::vector<Pair> out;
  for (const Pair& pair : pairs) {
    if (!out.empty() && out.back().a == pair.a && out.back().b == pair.b) {
      out.back().conductance_w_k += pair.conductance_w_k;
    } else {
      out.push_back(pair);
    }
  }
  pairs = std::move(out);
}

/// Columns of the samples of one instance.
class InstanceColumns {
 public:
  InstanceColumns(const SurfaceInputs& inputs, const SurfaceModel& model, std::uint32_t instance)
      : in_(inputs),
        object_(inputs.geometry.instances[instance].object),
        heat_(*inputs.heat.foster()),
        mesh_(model.meshes[inputs.geometry.instances[instance].mesh]),
        samples_(std::span(model.samples.samples)
                     .subspan(model.first_sample[instance], mesh_.vertices().size())) {
    const scene::Instance& own = inputs.geometry.instances[instance];
    // Take the axes of the samples: rel for static surfaces, else those of the body.
    const bool fixed = inputs.entity_of_object[own.object] < 0;
    glm::dmat4 from_mesh = fixed ? own.world_from_mesh : own.body_from_mesh;
    if (fixed) from_mesh[3] -= glm::dvec4(inputs.rays.origin_world_m(), 0.0);
    leaves_.reserve(mesh_.leaf_count());
    for (std::uint32_t slot = 0; slot < mesh_.leaf_count(); ++slot) {
      leaves_.push_back(mesh_.leaf(slot));
    }
    for (const RefinedMesh::Vertex& vertex : mesh_.vertices()) {
      place_m_.emplace_back(from_mesh * glm::dvec4(glm::dvec3(vertex.position_m), 1.0));
    }
  }

  /// Finds columns and pairs.
  void find() {
    find_creases();
    find_near();
    if (vertices_.empty()) return;
    make_delaunay();
    measure_cells();
    link_along();
    link_across();
    link_seams();
    join_pairs(pairs_);
  }
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
  [[nodiscard]] double excess_frac(std::size_t column) const {
    const SurfaceSample& sample = samples_[vertices_[column]];
    if (sample.covered) return 0.0;
    const double depth_m = cells(vertices_[column]).middle_m(0);
    if (!(static_cast<double>(sample.foot_m) < kExcessDepths * depth_m)) return 1.0;
    return 0.5 + std::atan(static_cast<double>(sample.foot_m) / depth_m) / physics::kPi;
  }
  /// Returns true if a solid stands on the instance.
  [[nodiscard]] bool any_at_foot() const {
    return std::ranges::any_of(vertices_, [&](std::uint32_t v) { return at_foot(v); });
  }
  /// Vertices of faces that stand on ground. They have no columns: the wall above them owns the
  /// material down to the ground.
  [[nodiscard]] std::span<const std::uint32_t> standing() const noexcept { return standing_; }
  /// Links the cells at the feet of walls with the ground under them, which is among `all`. Visits
  /// visit(own cell, ground's instance, cell there, conductance_w_k).
  template <class Visit>
  void each_foot(std::span<const InstanceColumns> all, const Visit& visit) const;
  /// Returns a column without links.
  [[nodiscard]] SampleColumn column(std::size_t index) const {
    const Measured& own = measured_[index];
    const ColumnCells& stack = cells(vertices_[index]);
    SampleColumn out;
    for (std::size_t l = 0; l < stack.count; ++l) {
      const double share = std::max(kLeastShare, own.held_m2[l] / own.area_m2);
      const double below_w_m2_k =
          std::max(kLeastShare * stack.below_w_m2_k(l), own.below_w_k[l] / own.area_m2);
      out.share_frac[l] = static_cast<float>(share);
      out.below_w_m2_k[l] = static_cast<float>(below_w_m2_k);
    }
    return out;
  }

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
  [[nodiscard]] glm::dvec3 inward(const Side& side) const {
    const glm::dvec3 edge = glm::normalize(place_m_[side.at_high] - place_m_[side.at_low]);
    const glm::dvec3 way = centre_m(side.slot()) - place_m_[side.at_low];
    const glm::dvec3 out = way - glm::dot(way, edge) * edge;
    const double length = glm::length(out);
    return length > 0.0 ? out / length : glm::dvec3(0.0);
  }

  /// Returns true for a face in a closed cavity.
  [[nodiscard]] static bool closed_in(const SurfaceSample& sample) noexcept {
    constexpr float kClosedFrac = 0.01F;
    return sample.sky_frac + sample.far_frac < kClosedFrac;
  }
  /// Returns the depth below a vertex of a wall up to which the material belongs to it: half of the
  /// way to the other face of the body, unless that one lies in a closed cavity.
  [[nodiscard]] double depth_m(std::uint32_t vertex, std::span<const InstanceColumns> all) const;
  /// Returns the ground on which the face at `beside`'s other side, with that outward normal,
  /// stands, if it does. Ground shows beside the body, in the plane of that face.
  [[nodiscard]] std::optional<CasterHit> ground_of(std::uint32_t beside,
                                                   const glm::dvec3& face) const {
    const SurfaceSample& own = samples_[beside];
    // The wall of a closed cavity has no foot: the material behind it counts from its outside.
    if (own.entity >= 0 || closed_in(own)) return std::nullopt;
    const float offset_m = ray_offsets(own.position_m, own.facet_m).around_m;
    const glm::vec3 m(face);
    const float lift_m = 2.0F * kBesideOffsets * offset_m;
    const CasterRay ray{own.position_m + kBesideOffsets * offset_m * own.normal - lift_m * m, m};
    std::array<CasterHit, 1> hit;
    const bool found = in_.places.first_hits({&ray, 1}, {true, {}}, hit) != 0U &&
                       std::abs(hit[0].distance_m - lift_m) < kBesideOffsets * offset_m &&
                       glm::dot(hit[0].normal, m) < -0.9F;
    return found ? std::optional(hit[0]) : std::nullopt;
  }
  /// Returns true if a place of the face of `beside` lies under a solid: the first face above it is
  /// seen from behind.
  [[nodiscard]] bool under_a_solid(const glm::dvec3& at_m, std::uint32_t beside) const {
    const SurfaceSample& own = samples_[beside];
    const float offset_m = ray_offsets(own.position_m, own.facet_m).around_m;
    const CasterRay ray{glm::vec3(at_m) + 2.0F * offset_m * own.normal, own.normal};
    std::array<CasterHit, 1> hit;
    return in_.places.first_hits({&ray, 1}, {true, {}}, hit) != 0U && !hit[0].front;
  }

  /// Finds the creases between faces that conduct, the neighbours of every leaf on its face, and
  /// vertices that share a place without a crease.
  void find_creases() {
    const auto vertices = mesh_.vertices();
    const std::vector<std::uint32_t> first = weld_positions(vertices);
    std::vector<Side> sides;
    for (std::uint32_t slot = 0; slot < leaf_count(); ++slot) {
      const auto& leaf = this->leaf(slot);
      if (!conducts(leaf[0])) continue;
      for (std::uint32_t k = 0; k < 3; ++k) {
        std::uint32_t a = leaf[k];
        std::uint32_t b = leaf[(k + 1) % 3];
        if (first[a] == first[b]) continue;
        if (first[a] > first[b]) std::swap(a, b);
        sides.push_back({first[a], first[b], 3 * slot + k, a, b});
      }
    }
    std::ranges::sort(sides, {},
                      [](const Side& s) { return std::tuple(s.low, s.high, s.half_edge); });
    near_.resize(vertices.size());
    beside_.assign(std::size_t{3} * leaf_count(), kNone);
    for (std::size_t i = 0; i < sides.size();) {
      std::size_t end = i + 1;
      while (end < sides.size() && sides[end].low == sides[i].low &&
             sides[end].high == sides[i].high) {
        ++end;
      }
      if (end - i == 2) {
        join(sides[i], sides[i + 1]);
      } else {
        for (std::size_t k = i; k < end; ++k) end_at(sides[k]);
      }
      i = end;
    }
    std::ranges::sort(seams_);
    seams_.erase(std::unique(seams_.begin(), seams_.end()), seams_.end());
  }
  /// Notes an edge between two leaves.
  void join(const Side& one, const Side& other) {
    const double length_m = glm::distance(place_m_[one.at_low], place_m_[one.at_high]);
    const glm::dvec3 n_one = normal(one.slot());
    const glm::dvec3 n_other = normal(other.slot());
    const double cosine = glm::dot(n_one, n_other);
    const bool own_vertices = one.at_low != other.at_low && one.at_high != other.at_high;
    if (!own_vertices || cosine > kFlatCos) {
      beside_[one.half_edge] = other.slot();
      beside_[other.half_edge] = one.slot();
      if (own_vertices) {
        seams_.push_back({std::min(one.at_low, other.at_low), std::max(one.at_low, other.at_low)});
        seams_.push_back(
            {std::min(one.at_high, other.at_high), std::max(one.at_high, other.at_high)});
      }
      return;
    }
    if (!(length_m > 0.0)) return;
    const bool convex = glm::dot(n_one, inward(other)) < 0.0;
    // Each face owns the material up to the plane that halves the angle between them.
    const double slant = std::min(
        kMaxSlant, std::sqrt(std::max(0.0, (1.0 - cosine) / std::max(1.0 + cosine, 1e-3))));
    // A face stands on ground that shows beside the wall on its other side.
    const auto ground = [&](const Side& wall, const glm::dvec3& face) {
      const std::optional<CasterHit> low =
          convex ? ground_of(wall.at_low, face) : std::optional<CasterHit>();
      return low && ground_of(wall.at_high, face) ? low : std::nullopt;
    };
    const std::optional<CasterHit> under_one = ground(other, n_one);
    const std::optional<CasterHit> under_other = ground(one, n_other);
    const auto add = [&](const Side& side, const Side& beside, const glm::dvec3& n,
                         const glm::dvec3& n_beside, bool stands,
                         const std::optional<CasterHit>& foot) {
      Crease crease;
      crease.begin_m = place_m_[side.at_low];
      crease.end_m = place_m_[side.at_high];
      crease.inward = inward(side);
      crease.across = inward(beside);
      crease.between = glm::normalize(n - n_beside);
      crease.own = {side.at_low, side.at_high};
      crease.other = {beside.at_low, beside.at_high};
      crease.other_slot = beside.slot();
      // The wall owns all of the material above the ground that it stands on.
      crease.slant = foot ? 0.0 : convex ? slant : -slant;
      crease.stands = stands;
      const auto index = static_cast<std::uint32_t>(creases_.size());
      if (foot) feet_.push_back({index, *foot});
      creases_.push_back(crease);
      offer(side.at_low, index);
      offer(side.at_high, index);
    };
    add(one, other, n_one, n_other, under_one.has_value(), under_other);
    add(other, one, n_other, n_one, under_other.has_value(), under_one);
  }

  /// Notes the end of a face if it stands on ground there. The face below it may be missing or have
  /// other edges.
  void end_at(const Side& side) {
    const glm::dvec3 in = inward(side);
    if (!(glm::length(in) > 0.0)) return;
    const std::optional<CasterHit> ground = ground_of(side.at_low, -in);
    if (!ground || !ground_of(side.at_high, -in)) return;
    Crease crease;
    crease.begin_m = place_m_[side.at_low];
    crease.end_m = place_m_[side.at_high];
    crease.inward = in;
    crease.own = crease.other = {side.at_low, side.at_high};
    crease.other_slot = side.slot();
    const auto index = static_cast<std::uint32_t>(creases_.size());
    feet_.push_back({index, *ground});
    creases_.push_back(crease);
    offer(side.at_low, index);
    offer(side.at_high, index);
  }

  /// Adds a crease to those near a vertex, unless one in the same direction is as near.
  void offer(std::uint32_t vertex, std::uint32_t crease) {
    if (!conducts(vertex)) return;
    const double away_m = distance_m(creases_[crease], place_m_[vertex]);
    if (away_m > reach_m(vertex)) return;
    Neighbourhood& own = near_[vertex];
    constexpr double kNearer = 1.0 - 1e-6;
    for (std::size_t k = 0; k < own.count; ++k) {
      if (glm::dot(creases_[own.near[k].crease].inward, creases_[crease].inward) < kSameCos) {
        continue;
      }
      if (!(away_m < kNearer * own.near[k].distance_m)) return;
      own.near[k] = {crease, away_m};
      waiting_.push_back(vertex);
      return;
    }
    if (own.count == Neighbourhood::kMost) return;
    own.near[own.count++] = {crease, away_m};
    waiting_.push_back(vertex);
  }

  /// Spreads the creases over the vertices within reach, from neighbour to neighbour.
  void spread_creases() {
    const std::size_t count = mesh_.vertices().size();
    std::vector<std::uint32_t> end(count + 1, 0);
    for (std::uint32_t slot = 0; slot < leaf_count(); ++slot) {
      for (const std::uint32_t v : leaf(slot)) end[v + 1] += 2;
    }
    for (const auto& [a, b] : seams_) ++end[a + 1], ++end[b + 1];
    for (std::size_t v = 1; v < end.size(); ++v) end[v] += end[v - 1];
    std::vector<std::uint32_t> beside(end.back());
    std::vector<std::uint32_t> at(end.begin(), end.end() - 1);
    for (std::uint32_t slot = 0; slot < leaf_count(); ++slot) {
      const auto& leaf = this->leaf(slot);
      for (std::size_t k = 0; k < 3; ++k) {
        beside[at[leaf[k]]++] = leaf[(k + 1) % 3];
        beside[at[leaf[k]]++] = leaf[(k + 2) % 3];
      }
    }
    for (const auto& [a, b] : seams_) {
      beside[at[a]++] = b;
      beside[at[b]++] = a;
    }
    while (!waiting_.empty()) {
      const std::uint32_t v = waiting_.front();
      waiting_.pop_front();
      const Neighbourhood from = near_[v];
      for (std::uint32_t k = end[v]; k < end[v + 1]; ++k) {
        for (std::size_t c = 0; c < from.count; ++c) offer(beside[k], from.near[c].crease);
      }
    }
  }
  /// Gives a column to the vertices near creases and feet.
  void find_near() {
    if (!waiting_.empty()) spread_creases();
    const std::size_t count = mesh_.vertices().size();
    column_of_.assign(count, kNone);
    for (std::uint32_t v = 0; v < count; ++v) {
      const auto near = std::span(near_[v].near).first(near_[v].count);
      if (std::ranges::any_of(near, [&](const Near& n) { return creases_[n.crease].stands; })) {
        standing_.push_back(v);
        continue;
      }
      if (near.empty() && !at_foot(v)) continue;
      column_of_[v] = static_cast<std::uint32_t>(vertices_.size());
      vertices_.push_back(v);
    }
    measured_.resize(vertices_.size());
  }

  /// Exchanges edges between leaves of a plane that have columns, until they are Delaunay
  /// triangles: with those no face between two columns has a negative width, however narrow the
  /// triangles are that the mesh has.
  void make_delaunay() {
    std::vector<std::uint32_t> open;
    for (std::uint32_t slot = 0; slot < leaf_count(); ++slot) {
      if (!any_column(leaf(slot))) continue;
      for (std::uint32_t k = 0; k < 3; ++k) open.push_back(3 * slot + k);
    }
    for (std::size_t left = kMostFlips * open.size(); left > 0 && !open.empty(); --left) {
      const std::uint32_t half_edge = open.back();
      open.pop_back();
      flip(half_edge, open);
    }
  }
  /// Returns the half-edge of a leaf that runs from the place of one vertex to that of another;
  /// kNone if it has none.
  [[nodiscard]] std::uint32_t half_edge(std::uint32_t slot, std::uint32_t from,
                                        std::uint32_t to) const {
    for (std::uint32_t k = 0; slot != kNone && k < 3; ++k) {
      if (place_m_[leaf(slot)[k]] == place_m_[from] &&
          place_m_[leaf(slot)[(k + 1) % 3]] == place_m_[to]) {
        return 3 * slot + k;
      }
    }
    return kNone;
  }
  /// Exchanges the edge of two leaves for the other diagonal if their angles on both sides of it
  /// add up to more than 180 degrees. `open` receives the edges around them.
  void flip(std::uint32_t edge, std::vector<std::uint32_t>& open) {
    const std::uint32_t s = edge / 3;
    const std::uint32_t o = beside_[edge];
    if (o == kNone) return;
    const std::uint32_t a = leaf(s)[edge % 3];
    const std::uint32_t b = leaf(s)[(edge + 1 - 3 * s) % 3];
    const std::uint32_t c = leaf(s)[(edge + 2 - 3 * s) % 3];
    const std::uint32_t back = half_edge(o, b, a);
    if (back == kNone || beside_[back] != s) return;
    const std::uint32_t j = back - 3 * o;
    // Only vertices that both leaves have in common can change hands.
    if (leaf(o)[j] != b || leaf(o)[(j + 1) % 3] != a) return;
    const std::uint32_t d = leaf(o)[(j + 2) % 3];
    if (samples_[c].material != samples_[d].material) return;
    const glm::dvec3 n = normal(s);
    if (!(glm::dot(n, normal(o)) > kPlaneCos)) return;
    const auto cotangent = [&](std::uint32_t top) {
      const glm::dvec3 to_a = place_m_[a] - place_m_[top];
      const glm::dvec3 to_b = place_m_[b] - place_m_[top];
      return glm::dot(to_a, to_b) / std::max(glm::length(glm::cross(to_a, to_b)), 1e-300);
    };
    if (!(cotangent(c) + cotangent(d) < -kLeastGain)) return;
    const auto turns = [&](std::uint32_t x, std::uint32_t y, std::uint32_t z) {
      return glm::dot(glm::cross(place_m_[y] - place_m_[x], place_m_[z] - place_m_[x]), n) > 0.0;
    };
    if (!turns(a, d, c) || !turns(d, b, c)) return;
    const std::uint32_t k = edge - 3 * s;
    const std::uint32_t beyond_bc = beside_[3 * s + (k + 1) % 3];
    const std::uint32_t beyond_ca = beside_[3 * s + (k + 2) % 3];
    const std::uint32_t beyond_ad = beside_[3 * o + (j + 1) % 3];
    const std::uint32_t beyond_db = beside_[3 * o + (j + 2) % 3];
    const std::uint32_t from_ad = half_edge(beyond_ad, d, a);
    const std::uint32_t from_bc = half_edge(beyond_bc, c, b);
    leaves_[s] = {a, d, c};
    leaves_[o] = {d, b, c};
    const std::array<std::uint32_t, 6> beyond{beyond_ad, o, beyond_ca, beyond_db, beyond_bc, s};
    for (std::uint32_t i = 0; i < 3; ++i) {
      beside_[3 * s + i] = beyond[i];
      beside_[3 * o + i] = beyond[3 + i];
    }
    if (from_ad != kNone) beside_[from_ad] = s;
    if (from_bc != kNone) beside_[from_bc] = o;
    for (const std::uint32_t next : {3 * s, 3 * s + 2, 3 * o, 3 * o + 1}) open.push_back(next);
  }

  [[nodiscard]] bool any_column(const std::array<std::uint32_t, 3>& leaf) const {
    return std::ranges::any_of(leaf, [&](std::uint32_t v) { return column_of_[v] != kNone; });
  }
  /// Returns where the material below a point of a leaf ends.
  [[nodiscard]] End end_below(const std::array<std::uint32_t, 3>& leaf,
                              const glm::dvec3& at_m) const {
    End end;
    for (const std::uint32_t v : leaf) {
      for (std::size_t k = 0; k < near_[v].count; ++k) {
        const std::uint32_t index = near_[v].near[k].crease;
        const Crease& crease = creases_[index];
        if (!(crease.slant > 0.0)) continue;
        // The piece that is nearest to the vertex stands for its neighbours too.
        const double away_m = distance_m(crease, at_m, glm::distance(at_m, place_m_[v]));
        if (away_m / crease.slant < end.depth_m) end = {away_m / crease.slant, index, away_m};
      }
    }
    return end;
  }
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

  /// Gives what lies open of a leaf to its open corners.
  void expose(std::uint32_t slot) {
    const auto leaf = this->leaf(slot);
    const auto covered = [&](std::uint32_t v) { return samples_[v].covered; };
    const auto count = std::ranges::count_if(leaf, covered);
    if (count == 3) return;
    // A foot may cut the leaf, or run along its sides.
    const glm::dvec3 centre = centre_m(slot);
    const bool cut = std::ranges::any_of(leaf, [&](std::uint32_t v) {
      return covered(v) ||
             static_cast<double>(samples_[v].foot_m) < 2.0 * glm::distance(place_m_[v], centre);
    });
    for (std::size_t k = 0; k < 3; ++k) {
      each_point(slot, k, [&](const glm::dvec3& at_m, double area_m2) {
        std::uint32_t taker = leaf[k];
        if (cut && samples_[taker].entity < 0) {
          if (under_a_solid(at_m, taker)) return;
          // Take the nearest open corner.
          for (const std::uint32_t v : leaf) {
            if (covered(v)) continue;
            if (covered(taker) ||
                glm::distance(place_m_[v], at_m) < glm::distance(place_m_[taker], at_m)) {
              taker = v;
            }
          }
        }
        if (covered(taker) || column_of_[taker] == kNone) return;
        measured_[column_of_[taker]].exposed_m2 += area_m2;
      });
    }
  }

  /// Measures volumes, areas and middles of all cells.
  void measure_cells() {
    for (std::uint32_t slot = 0; slot < leaf_count(); ++slot) {
      const auto leaf = this->leaf(slot);
      if (!any_column(leaf)) continue;
      expose(slot);
      const glm::dvec3 n = normal(slot);
      for (std::size_t k = 0; k < 3; ++k) {
        if (column_of_[leaf[k]] == kNone) continue;
        const ColumnCells& stack = cells(leaf[k]);
        Measured& own = measured_[column_of_[leaf[k]]];
        each_point(slot, k, [&](const glm::dvec3& at_m, double area_m2) {
          const double end_m = end_below(leaf, at_m).depth_m;
          own.area_m2 += area_m2;
          for (std::size_t l = 0; l < stack.count; ++l) {
            const double share = share_above(stack.top_m[l], stack.top_m[l + 1], end_m);
            own.held_m2[l] += area_m2 * share;
            // The rest of a cell beside the plane and its counterpart beyond make up a whole
            // cell, so that heat goes to its middle.
            const double next_m =
                l + 1 < stack.count ? stack.middle_m(l + 1) : stack.top_m[stack.count];
            own.below_w_k[l] +=
                area_m2 * stack.below_w_m2_k(l) * share_above(stack.middle_m(l), next_m, end_m);
            const double depth_m = stack.top_m[l] + 0.5 * share * stack.thickness_m(l);
            own.middle_m[l] += area_m2 * share * (at_m - depth_m * n);
          }
        });
      }
    }
    // Material behind a concave edge belongs to the columns on it, up to the plane between the
    // faces.
    for (const Crease& crease : creases_) {
      for (const std::uint32_t v : crease.own) {
        if (column_of_[v] == kNone) continue;
        if (crease.slant >= 0.0) continue;
        Measured& own = measured_[column_of_[v]];
        const ColumnCells& stack = cells(v);
        const glm::dvec3 n(samples_[v].normal);
        const double half_m = 0.5 * glm::distance(crease.begin_m, crease.end_m);
        const glm::dvec3 along_m = 0.25 * (crease.begin_m + crease.end_m - 2.0 * place_m_[v]);
        for (std::size_t l = 0; l < stack.count; ++l) {
          const double back_m = -crease.slant * stack.middle_m(l);
          own.held_m2[l] += back_m * half_m;
          own.below_w_k[l] += -crease.slant * stack.top_m[l + 1] * half_m * stack.below_w_m2_k(l);
          own.middle_m[l] +=
              back_m * half_m *
              (place_m_[v] + along_m - 0.5 * back_m * crease.inward - stack.middle_m(l) * n);
        }
      }
    }
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      Measured& own = measured_[i];
      const std::uint32_t v = vertices_[i];
      const ColumnCells& stack = cells(v);
      for (std::size_t l = 0; l < stack.count; ++l) {
        if (own.held_m2[l] > 0.0) {
          own.middle_m[l] /= own.held_m2[l];
        } else {
          own.middle_m[l] = place_m_[v] - stack.middle_m(l) * glm::dvec3(samples_[v].normal);
        }
      }
    }
  }

  /// Adds a conductance between cells.
  void add(std::uint32_t a, std::size_t l, std::uint32_t b, std::size_t m, double conductance_w_k) {
    if (!(conductance_w_k > 0.0)) return;
    auto one = static_cast<std::uint32_t>(column_of_[a] * kMaxColumnCells + l);
    auto other = static_cast<std::uint32_t>(column_of_[b] * kMaxColumnCells + m);
    if (one > other) std::swap(one, other);
    pairs_.push_back({one, other, conductance_w_k});
  }
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
  void link_along() {
    struct Half {
      std::uint32_t a = 0;
      std::uint32_t b = 0;
      double width_m = 0.0;
      double end_m = 0.0;
    };
    std::vector<Half> halves;
    for (std::uint32_t slot = 0; slot < leaf_count(); ++slot) {
      const auto& leaf = this->leaf(slot);
      if (!any_column(leaf)) continue;
      const glm::dvec3 centre = centre_m(slot);
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = leaf[k];
        const std::uint32_t b = leaf[(k + 1) % 3];
        if (column_of_[a] == kNone || column_of_[b] == kNone) continue;
        // The face between two vertices ends at the centre of the circle around the leaf.
        const glm::dvec3& top_m = place_m_[leaf[(k + 2) % 3]];
        const glm::dvec3 to_a = place_m_[a] - top_m;
        const glm::dvec3 to_b = place_m_[b] - top_m;
        const double sine = glm::length(glm::cross(to_a, to_b));
        if (!(sine > 0.0)) continue;
        const glm::dvec3 middle = 0.5 * (place_m_[a] + place_m_[b]);
        halves.push_back(
            {std::min(a, b), std::max(a, b),
             0.5 * glm::dot(to_a, to_b) / sine * glm::distance(place_m_[a], place_m_[b]),
             end_below(leaf, 0.5 * (middle + centre)).depth_m});
      }
    }
    std::ranges::stable_sort(halves, {}, [](const Half& h) { return std::pair(h.a, h.b); });
    for (std::size_t i = 0; i < halves.size();) {
      const auto [a, b, w, e] = halves[i];
      std::size_t end = i + 1;
      while (end < halves.size() && halves[end].a == a && halves[end].b == b) ++end;
      const std::span<const Half> both = std::span(halves).subspan(i, end - i);
      const glm::dvec3 way_m = place_m_[b] - place_m_[a];
      const double length_m = glm::length(way_m);
      each_beside(a, b, [&](std::size_t l, std::size_t m, double thickness_m) {
        // Sum up both sides of the edge; a face of negative width conducts nothing.
        double width_m = 0.0;
        for (const Half& half : both) {
          width_m +=
              half.width_m * share_above(cells(a).top_m[l], cells(a).top_m[l + 1], half.end_m);
        }
        const double k_a = cells(a).conductivity_w_m_k[l];
        const double k_b = cells(b).conductivity_w_m_k[m];
        add(a, l, b, m, 2.0 * k_a * k_b / (k_a + k_b) * width_m * thickness_m / length_m);
      });
      i = end;
    }
  }

  /// Returns the leaf that holds a point of a face, walking from `slot`; kNone if the walk leaves
  /// the face. `weight` receives the shares of its corners.
  [[nodiscard]] std::uint32_t locate(std::uint32_t slot, const glm::dvec3& at_m,
                                     std::array<double, 3>& weight) const {
    for (int step = 0; step < kMostSteps; ++step) {
      const auto& leaf = this->leaf(slot);
      const glm::dvec3 n_m2 = area_vector_m2(slot);
      const double area_m4 = glm::dot(n_m2, n_m2);
      if (!(area_m4 > 0.0)) return kNone;
      std::size_t least = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const glm::dvec3& from_m = place_m_[leaf[(k + 1) % 3]];
        const glm::dvec3& to_m = place_m_[leaf[(k + 2) % 3]];
        weight[k] = 0.5 * glm::dot(glm::cross(to_m - from_m, at_m - from_m), n_m2) / area_m4;
        if (weight[k] < weight[least]) least = k;
      }
      constexpr double kInside = -1e-6;
      if (weight[least] >= kInside) return slot;
      const std::uint32_t next = beside_[3 * slot + (least + 1) % 3];
      if (next == kNone) {
        // Take the nearest place of the last leaf if the point lies just outside of the face.
        for (double& w : weight) w = std::max(w, 0.0);
        const double sum = weight[0] + weight[1] + weight[2];
        for (double& w : weight) w /= sum;
        return slot;
      }
      slot = next;
    }
    return kNone;
  }

  /// Adds half of the conductance between a cell and one across a crease, whose plane it meets over
  /// an area. The other half comes from the other side.
  void add_across(const Crease& crease, std::uint32_t a, std::size_t l, std::uint32_t b,
                  std::size_t m, double area_m2) {
    const auto to_plane_m = [&](std::uint32_t v, std::size_t cell) {
      return std::max(kLeastThickness * cells(v).thickness_m(cell),
                      std::abs(glm::dot(middle_m(v, cell) - crease.begin_m, crease.between)));
    };
    const double resistance = to_plane_m(a, l) / cells(a).conductivity_w_m_k[l] +
                              to_plane_m(b, m) / cells(b).conductivity_w_m_k[m];
    add(a, l, b, m, 0.5 * area_m2 / resistance);
  }

  /// Links columns that meet in the plane that halves the angle of a crease.
  void link_across() {
    for (std::uint32_t slot = 0; slot < leaf_count(); ++slot) {
      const auto leaf = this->leaf(slot);
      if (!any_column(leaf)) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = leaf[k];
        if (column_of_[a] == kNone) continue;
        each_point(slot, k, [&](const glm::dvec3& at_m, double area_m2) {
          const End end = end_below(leaf, at_m);
          if (end.crease == kNone || end.depth_m >= thickness_m(a)) return;
          const Crease& crease = creases_[end.crease];
          // Find the same place on the other face.
          const glm::dvec3 mirrored_m =
              at_m - end.distance_m * crease.inward + end.distance_m * crease.across;
          std::array<double, 3> weight{};
          const std::uint32_t found = locate(crease.other_slot, mirrored_m, weight);
          if (found == kNone) return;
          const double tilted_m2 = area_m2 * std::sqrt(1.0 + 1.0 / (crease.slant * crease.slant));
          const std::size_t l = cells(a).at(end.depth_m);
          // It belongs to the corner with the greatest share. To spread it over all three would
          // carry heat along the surface.
          const auto corner =
              static_cast<std::size_t>(std::ranges::max_element(weight) - weight.begin());
          const std::uint32_t b = this->leaf(found)[corner];
          if (column_of_[b] == kNone) return;
          add_across(crease, a, l, b, cells(b).at(end.depth_m), tilted_m2);
        });
      }
    }
    for (const Crease& crease : creases_) {
      if (crease.slant >= 0.0) continue;
      const double length_m = glm::distance(crease.begin_m, crease.end_m);
      for (std::size_t e = 0; e < 2; ++e) {
        const std::uint32_t a = crease.own[e];
        const std::uint32_t b = crease.other[e];
        if (column_of_[a] == kNone || column_of_[b] == kNone) continue;
        for (std::size_t l = 0; l < cells(a).count; ++l) {
          const double area_m2 = 0.5 * length_m * cells(a).thickness_m(l) *
                                 std::sqrt(1.0 + crease.slant * crease.slant);
          add_across(crease, a, l, b, cells(b).at(cells(a).middle_m(l)), area_m2);
        }
      }
      // The material behind the edge conducts along it too.
      const std::uint32_t a = crease.own[0];
      const std::uint32_t b = crease.own[1];
      if (column_of_[a] == kNone || column_of_[b] == kNone) continue;
      each_beside(a, b, [&](std::size_t l, std::size_t m, double thickness_m) {
        const double k_a = cells(a).conductivity_w_m_k[l];
        const double k_b = cells(b).conductivity_w_m_k[m];
        const double width_m = -crease.slant * cells(a).middle_m(l);
        add(a, l, b, m, 2.0 * k_a * k_b / (k_a + k_b) * width_m * thickness_m / length_m);
      });
    }
  }

  /// Links columns at one place on faces without a crease between them.
  void link_seams() {
    for (const auto& [a, b] : seams_) {
      if (column_of_[a] == kNone || column_of_[b] == kNone) continue;
      each_beside(a, b, [&](std::size_t l, std::size_t m, double thickness_m) {
        const double k_a = cells(a).conductivity_w_m_k[l];
        const double k_b = cells(b).conductivity_w_m_k[m];
        add(a, l, b, m, 2.0 * k_a * k_b / (k_a + k_b) * thickness_m / kSeamWays);
      });
    }
  }

  const SurfaceInputs& in_;
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
  std::vector<Foot> feet_;
  std::vector<std::uint32_t> standing_;
  std::deque<std::uint32_t> waiting_;
  std::vector<std::uint32_t> column_of_;  ///< by vertex
  std::vector<std::uint32_t> vertices_;   ///< by column
  std::vector<Measured> measured_;        ///< by column
  std::vector<Pair> pairs_;
};

double InstanceColumns::depth_m(std::uint32_t vertex, std::span<const InstanceColumns> all) const {
  const SurfaceSample& own = samples_[vertex];
  const float offset_m = ray_offsets(own.position_m, own.facet_m).around_m;
  const CasterRay ray{own.position_m - 2.0F * offset_m * own.normal, -own.normal};
  std::array<CasterHit, 1> hit;
  constexpr double kDeepM = 1e9;
  if (in_.places.first_hits({&ray, 1}, {true, {}}, hit) == 0U) return kDeepM;
  const InstanceColumns& body = all[hit[0].instance];
  const auto there = body.mesh_.locate(hit[0].triangle, hit[0].barycentric);
  return closed_in(body.samples_[there.vertex[0]])
             ? kDeepM
             : 0.5 * static_cast<double>(hit[0].distance_m + 2.0F * offset_m);
}

template <class Visit>
void InstanceColumns::each_foot(std::span<const InstanceColumns> all, const Visit& visit) const {
  for (const Foot& foot : feet_) {
    const Crease& crease = creases_[foot.crease];
    const InstanceColumns& ground = all[foot.ground.instance];
    if (ground.vertices_.empty()) continue;
    const std::uint32_t beside =
        ground.mesh_.locate(foot.ground.triangle, foot.ground.barycentric).slot;
    const glm::dvec3 up(foot.ground.normal);
    const double half_m = 0.5 * glm::distance(crease.begin_m, crease.end_m);
    for (std::size_t e = 0; e < 2; ++e) {
      const std::uint32_t a = crease.own[e];
      if (column_of_[a] == kNone) continue;
      const double own_depth_m = depth_m(a, all);
      const ColumnCells& wall = cells(a);
      const Measured& own = measured_[column_of_[a]];
      const glm::dvec3 foot_m =
          place_m_[a] + 0.25 * (crease.begin_m + crease.end_m - 2.0 * place_m_[a]);
      // Go through the depth of the wall. The ground below takes up the heat through the upper half
      // of its first cell.
      for (std::size_t k = 0; k < kPoints * wall.count; ++k) {
        const std::size_t l = k / kPoints;
        const double part_m = wall.thickness_m(l) / kPoints;
        const double top_m = wall.top_m[l] + static_cast<double>(k % kPoints) * part_m;
        const double area_m2 = half_m * part_m * share_above(top_m, top_m + part_m, own_depth_m) *
                               std::clamp(own.held_m2[l] / own.area_m2, 0.0, 1.0);
        const glm::dvec3 under_m = foot_m - (top_m + 0.5 * part_m) * glm::dvec3(samples_[a].normal);
        std::array<double, 3> weight{};
        const std::uint32_t slot = ground.locate(beside, under_m, weight);
        if (slot == kNone) continue;
        // Ground that begins beside the wall lies open.
        const auto& leaf = ground.leaf(slot);
        const auto under = [&](std::size_t corner) {
          const SurfaceSample& below = ground.samples_[leaf[corner]];
          return below.covered ||
                 below.foot_m <
                     kBesideOffsets * ray_offsets(below.position_m, below.facet_m).around_m;
        };
        std::size_t corner = 0;
        for (std::size_t i = 1; i < 3; ++i) {
          if (std::pair(under(i), weight[i]) > std::pair(under(corner), weight[corner])) corner = i;
        }
        const std::uint32_t b = leaf[corner];
        if (ground.column_of_[b] == kNone) continue;
        const double height_m =
            std::max(kLeastThickness * wall.thickness_m(l), glm::dot(own.middle_m[l] - foot_m, up));
        const double resistance =
            height_m / wall.conductivity_w_m_k[l] + 0.5 * ground.cells(b).resistance_m2k_w[0] +
            in_.joints.resistance_m2k_w(object_, in_.materials[samples_[a].material],
                                        ground.object_, in_.materials[ground.samples_[b].material]);
        visit(static_cast<std::uint32_t>(column_of_[a] * kMaxColumnCells + l), foot.ground.instance,
              static_cast<std::uint32_t>(ground.column_of_[b] * kMaxColumnCells),
              area_m2 / resistance);
      }
    }
  }
}

/// Lays out the columns and links of all instances in the model.
void lay_out(std::span<const InstanceColumns> found, SurfaceModel& model) {
  SurfaceSamples& all = model.samples;
  // Number the columns of all instances, and collect their conductances.
  std::vector<std::uint32_t> first;
  std::vector<double> area_m2;
  for (const InstanceColumns& each : found) {
    first.push_back(static_cast<std::uint32_t>(area_m2.size()));
    for (std::size_t c = 0; c < each.vertices().size(); ++c) area_m2.push_back(each.area_m2(c));
  }
  const auto cell = [&](std::size_t instance, std::uint32_t own) {
    return first[instance] * static_cast<std::uint32_t>(kMaxColumnCells) + own;
  };
  std::vector<Pair> pairs;
  std::vector<std::uint8_t> at_feet(found.size(), 0);
  for (std::size_t p = 0; p < found.size(); ++p) {
    if (found[p].any_at_foot()) at_feet[p] = 1;
    for (const Pair& pair : found[p].pairs()) {
      pairs.push_back({cell(p, pair.a), cell(p, pair.b), pair.conductance_w_k});
    }
    found[p].each_foot(found, [&](std::uint32_t own, std::uint32_t ground, std::uint32_t under,
                                  double conductance_w_k) {
      if (!(conductance_w_k > 0.0)) return;
      at_feet[p] = at_feet[ground] = 1;
      const std::uint32_t a = cell(p, own);
      const std::uint32_t b = cell(ground, under);
      pairs.push_back({std::min(a, b), std::max(a, b), conductance_w_k});
    });
  }
  join_pairs(pairs);
  // Count the links of each cell, and lay them out in the order of the cells.
  const auto each_link = [&](const auto& visit) {
    for (const Pair& pair : pairs) {
      visit(pair.a, pair.b, pair.conductance_w_k);
      visit(pair.b, pair.a, pair.conductance_w_k);
    }
  };
  std::vector<std::uint32_t> at(area_m2.size() * kMaxColumnCells + 1, 0);
  each_link([&](std::uint32_t own, std::uint32_t, double) { ++at[own + 1]; });
  for (std::size_t i = 1; i < at.size(); ++i) at[i] += at[i - 1];
  for (std::size_t p = 0; p < found.size(); ++p) {
    const std::uint32_t first_sample = model.first_sample[p];
    for (std::size_t c = 0; c < found[p].vertices().size(); ++c) {
      SampleColumn column = found[p].column(c);
      column.sample = first_sample + found[p].vertices()[c];
      column.area_m2 = static_cast<float>(found[p].area_m2(c));
      const std::size_t index = first[p] + c;
      for (std::size_t l = 0; l <= kMaxColumnCells; ++l) {
        column.first_link[l] = at[index * kMaxColumnCells + l];
      }
      SurfaceSample& sample = all.samples[column.sample];
      sample.column = static_cast<std::uint32_t>(index);
      sample.exposed_frac = static_cast<float>(found[p].exposed_frac(c));
      sample.excess_frac = static_cast<float>(found[p].excess_frac(c));
      sample.felt_frac = at_feet[p] != 0 ? 0.0F : 1.0F;
      all.columns.push_back(column);
    }
    for (const std::uint32_t v : found[p].standing()) all.samples[first_sample + v].covered = true;
  }
  all.links.resize(at.back());
  each_link([&](std::uint32_t own, std::uint32_t other, double conductance_w_k) {
    all.links[at[own]++] = {other / static_cast<std::uint32_t>(kMaxColumnCells),
                            other % static_cast<std::uint32_t>(kMaxColumnCells),
                            static_cast<float>(conductance_w_k / area_m2[own / kMaxColumnCells])};
  });
}

}  // namespace

float foot_reach_m(const scene::Material& material) noexcept {
  if (material.prescribed_k || material.sheet) return 0.0F;
  double thickness_m = 0.0;
  for (const scene::Layer& layer : material.layers) thickness_m += layer.thickness_m;
  return static_cast<float>(std::min(kFootReachM, kReachThicknesses * thickness_m));
}

void link_columns(const SurfaceInputs& inputs, SurfaceModel& model) {
  if (inputs.heat.foster() == nullptr) return;
  const std::size_t instances = inputs.geometry.instances.size();
  std::vector<InstanceColumns> found;
  found.reserve(instances);
  for (std::uint32_t p = 0; p < instances; ++p) found.emplace_back(inputs, model, p);
  threads::parallel_parts(instances, 1, [&](std::size_t from, std::size_t to) {
    for (std::size_t p = from; p < to; ++p) found[p].find();
  });
  lay_out(found, model);
}

}  // namespace emit::renderer
