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
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "emit/threads/parallel.hpp"
#include "surface/mesh/refined_mesh_edges.hpp"
#include "surface/model/vertex_areas.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer {
namespace {

/// Cosine between the normals of two faces above which the edge between them is no crease: the
/// facets of a round side.
constexpr double kFlatCos = 0.9;
/// Distance from a crease within which samples are linked, in thicknesses of their stack.
constexpr double kReachThicknesses = 2.0;
/// Greatest such distance, in m.
constexpr double kMaxReachM = 1.0;
/// Shortest way between two lumps, in widths of the face between them. Lumps beyond the plane where
/// another face takes over lie at one place and pass heat on; a longer way there would add up over
/// all of them and hold back the heat that goes around an edge.
constexpr double kLeastWays = 1.0 / 64.0;
/// Mean distance from a crease of the column of a vertex on it, in roots of its area: the column
/// reaches half of a vertex spacing inwards, and the area is half of that spacing squared.
constexpr double kMeanOnCrease = 0.35;
/// Cosine between the directions away from two creases above which they are one edge.
constexpr double kSameCos = 0.9;
/// Distance, in ray offsets, that counts as touching: ground touches a body if it lies this close
/// beside it, and this close to the plane of its face.
constexpr float kBesideOffsets = 6.0F;

using Lumps = physics::FosterState<double>;

/// Piece of an edge between two faces that meet at an angle, seen from one of them.
struct Crease {
  glm::dvec3 begin_m{0.0};
  glm::dvec3 end_m{0.0};
  glm::dvec3 inward{0.0};  ///< unit length, in the face, away from the edge
  /// Distance from the edge per depth at which the other face takes over; 0 at a concave edge.
  double slant = 0.0;
  bool stands = false;  ///< the face stands on ground there
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

double distance_m(const Crease& crease, const glm::dvec3& at_m) {
  const glm::dvec3 way_m = crease.end_m - crease.begin_m;
  const double along = glm::dot(at_m - crease.begin_m, way_m) / glm::dot(way_m, way_m);
  return glm::distance(at_m, crease.begin_m + std::clamp(along, 0.0, 1.0) * way_m);
}

/// Conductances between two vertices of an instance.
struct Pair {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  Lumps conductance_w_k{};
};

/// Links the samples of one instance.
class InstanceLinks {
 public:
  InstanceLinks(const SurfaceInputs& inputs, const SurfaceModel& model, std::uint32_t instance)
      : in_(inputs),
        heat_(*inputs.heat.foster()),
        mesh_(model.meshes[inputs.geometry.instances[instance].mesh]),
        samples_(std::span(model.samples.samples)
                     .subspan(model.first_sample[instance], mesh_.vertices().size())) {
    const scene::Instance& own = inputs.geometry.instances[instance];
    // Take the axes of the samples: rel for static surfaces, else those of the body.
    const bool fixed = inputs.entity_of_object[own.object] < 0;
    glm::dmat4 from_mesh = fixed ? own.world_from_mesh : own.body_from_mesh;
    if (fixed) from_mesh[3] -= glm::dvec4(inputs.rays.origin_world_m(), 0.0);
    for (const RefinedMesh::Vertex& vertex : mesh_.vertices()) {
      place_m_.emplace_back(from_mesh * glm::dvec4(glm::dvec3(vertex.position_m), 1.0));
    }
    area_m2_ = vertex_areas_m2(mesh_, own);
  }

  /// Finds the pairs, and the cuts and covers of the vertices.
  void find() {
    find_creases();
    if (creases_.empty()) return;
    find_near();
    find_cuts();
    find_pairs();
  }
  [[nodiscard]] std::span<const Pair> pairs() const noexcept { return pairs_; }
  [[nodiscard]] std::span<const float> area_m2() const noexcept { return area_m2_; }
  [[nodiscard]] std::uint8_t cut(std::uint32_t vertex) const noexcept { return cut_[vertex]; }
  [[nodiscard]] bool stands(std::uint32_t vertex) const noexcept { return stands_[vertex]; }

 private:
  /// One side of an edge of the welded mesh.
  struct Side {
    std::uint32_t low = 0;  ///< welded vertices at its ends
    std::uint32_t high = 0;
    std::uint32_t slot = 0;
    std::uint32_t at_low = 0;  ///< own vertices there
    std::uint32_t at_high = 0;
  };

  [[nodiscard]] const physics::ConductionColumn* column(std::uint32_t vertex) const {
    return samples_[vertex].other_side == kNoSample ? heat_.column(samples_[vertex].material)
                                                    : nullptr;
  }
  [[nodiscard]] double thickness_m(std::uint32_t vertex) const {
    double sum_m = 0.0;
    for (const auto& layer : heat_.layers(samples_[vertex].material)) sum_m += layer.thickness_m;
    return sum_m;
  }
  [[nodiscard]] double reach_m(std::uint32_t vertex) const {
    return std::min(kMaxReachM, kReachThicknesses * thickness_m(vertex));
  }
  [[nodiscard]] glm::dvec3 normal(std::uint32_t slot) const {
    const auto& leaf = mesh_.leaf(slot);
    const glm::dvec3 across =
        glm::cross(place_m_[leaf[1]] - place_m_[leaf[0]], place_m_[leaf[2]] - place_m_[leaf[0]]);
    const double length = glm::length(across);
    return length > 0.0 ? across / length : glm::dvec3(0.0);
  }
  /// Returns the unit direction from an edge into a leaf.
  [[nodiscard]] glm::dvec3 inward(const Side& side) const {
    const auto& leaf = mesh_.leaf(side.slot);
    const glm::dvec3 edge = glm::normalize(place_m_[side.at_high] - place_m_[side.at_low]);
    const glm::dvec3 way =
        (place_m_[leaf[0]] + place_m_[leaf[1]] + place_m_[leaf[2]]) / 3.0 - place_m_[side.at_low];
    const glm::dvec3 out = way - glm::dot(way, edge) * edge;
    const double length = glm::length(out);
    return length > 0.0 ? out / length : glm::dvec3(0.0);
  }

  /// Returns true if the face at `vertex`, with that outward normal, stands on ground there. Ground
  /// shows beside the body, in the plane of that face; `beside` is a vertex of the other face.
  [[nodiscard]] bool stands_on_ground(std::uint32_t beside, const glm::dvec3& face) const {
    const SurfaceSample& own = samples_[beside];
    CasterSelection selection{true, {}};
    std::vector<EntityPlacement> placed;
    if (own.entity >= 0) return false;
    placed.assign(in_.entities_now.size(), {});
    for (EntityPlacement& place : placed) place.on = false;
    selection.entities = placed;
    const float offset_m = ray_offsets(own.position_m, own.facet_m).around_m;
    const glm::vec3 m(face);
    const float lift_m = 2.0F * kBesideOffsets * offset_m;
    const CasterRay ray{own.position_m + kBesideOffsets * offset_m * own.normal - lift_m * m, m};
    std::array<CasterHit, 1> hit;
    return in_.places.first_hits({&ray, 1}, selection, hit) != 0U &&
           std::abs(hit[0].distance_m - lift_m) < kBesideOffsets * offset_m &&
           glm::dot(hit[0].normal, m) < -0.9F;
  }

  /// Finds the creases between faces of the instance that both conduct, and the vertices that share
  /// a place along them.
  void find_creases() {
    const auto vertices = mesh_.vertices();
    const std::vector<std::uint32_t> first = weld_positions(vertices);
    std::vector<std::uint8_t> doubled(vertices.size(), 0);
    for (std::uint32_t v = 0; v < vertices.size(); ++v) {
      if (first[v] != v) doubled[v] = doubled[first[v]] = 1;
    }
    std::vector<Side> sides;
    for (std::uint32_t slot = 0; slot < mesh_.leaf_count(); ++slot) {
      const auto& leaf = mesh_.leaf(slot);
      if (column(leaf[0]) == nullptr) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        std::uint32_t a = leaf[k];
        std::uint32_t b = leaf[(k + 1) % 3];
        if (doubled[a] == 0 || doubled[b] == 0 || first[a] == first[b]) continue;
        if (first[a] > first[b]) std::swap(a, b);
        sides.push_back({first[a], first[b], slot, a, b});
      }
    }
    std::ranges::sort(sides, {}, [](const Side& s) { return std::tuple(s.low, s.high, s.slot); });
    near_.resize(vertices.size());
    for (std::size_t i = 0; i < sides.size();) {
      std::size_t end = i + 1;
      while (end < sides.size() && sides[end].low == sides[i].low &&
             sides[end].high == sides[i].high) {
        ++end;
      }
      if (end - i == 2 && sides[i].at_low != sides[i + 1].at_low) join(sides[i], sides[i + 1]);
      i = end;
    }
  }
  /// Notes an edge between two leaves that have vertices of their own.
  void join(const Side& one, const Side& other) {
    const double length_m = glm::distance(place_m_[one.at_low], place_m_[one.at_high]);
    if (!(length_m > 0.0)) return;
    twins_.push_back({std::min(one.at_low, other.at_low), std::max(one.at_low, other.at_low)});
    twins_.push_back({std::min(one.at_high, other.at_high), std::max(one.at_high, other.at_high)});
    const glm::dvec3 n_one = normal(one.slot);
    const glm::dvec3 n_other = normal(other.slot);
    const double cosine = glm::dot(n_one, n_other);
    if (cosine > kFlatCos) return;
    const bool convex = glm::dot(n_one, inward(other)) < 0.0;
    // Each face owns the material up to the plane that halves the angle between them.
    const double slant =
        convex ? std::sqrt(std::max(0.0, (1.0 - cosine) / std::max(1.0 + cosine, 1e-3))) : 0.0;
    const auto add = [&](const Side& side, const Side& beside, const glm::dvec3& n) {
      Crease crease{place_m_[side.at_low], place_m_[side.at_high], inward(side), slant, false};
      crease.stands =
          convex && stands_on_ground(beside.at_low, n) && stands_on_ground(beside.at_high, n);
      const auto index = static_cast<std::uint32_t>(creases_.size());
      creases_.push_back(crease);
      offer(side.at_low, index);
      offer(side.at_high, index);
    };
    add(one, other, n_one);
    add(other, one, n_other);
  }

  /// Adds a crease to those near a vertex, unless one in the same direction is as near.
  void offer(std::uint32_t vertex, std::uint32_t crease) {
    if (column(vertex) == nullptr) return;
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
  void find_near() {
    const std::size_t count = mesh_.vertices().size();
    std::vector<std::uint32_t> end(count + 1, 0);
    for (std::uint32_t slot = 0; slot < mesh_.leaf_count(); ++slot) {
      for (const std::uint32_t v : mesh_.leaf(slot)) end[v + 1] += 2;
    }
    for (std::size_t v = 1; v < end.size(); ++v) end[v] += end[v - 1];
    std::vector<std::uint32_t> beside(end.back());
    std::vector<std::uint32_t> at(end.begin(), end.end() - 1);
    for (std::uint32_t slot = 0; slot < mesh_.leaf_count(); ++slot) {
      const auto& leaf = mesh_.leaf(slot);
      for (std::size_t k = 0; k < 3; ++k) {
        beside[at[leaf[k]]++] = leaf[(k + 1) % 3];
        beside[at[leaf[k]]++] = leaf[(k + 2) % 3];
      }
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

  /// Finds where the columns end.
  void find_cuts() {
    cut_.assign(near_.size(), 0);
    stands_.assign(near_.size(), false);
    for (std::uint32_t v = 0; v < near_.size(); ++v) {
      const Neighbourhood& own = near_[v];
      if (own.count == 0) continue;
      const double least_m = kMeanOnCrease * std::sqrt(static_cast<double>(area_m2_[v]));
      double cut_m = 2.0 * thickness_m(v);
      for (std::size_t k = 0; k < own.count; ++k) {
        const Crease& crease = creases_[own.near[k].crease];
        stands_[v] = stands_[v] || crease.stands;
        if (!(crease.slant > 0.0)) continue;
        cut_m = std::min(cut_m, std::max(own.near[k].distance_m, least_m) / crease.slant);
      }
      const double way = std::sqrt(cut_m / thickness_m(v)) * (kColumnCuts + 1.0);
      const auto cut = static_cast<std::uint32_t>(std::clamp(std::lround(way), 1L, 100L));
      cut_[v] = static_cast<std::uint8_t>(cut > kColumnCuts ? 0 : cut);
    }
  }

  /// Place of a lump of a column: below its vertex, and beyond the planes where other faces take
  /// over.
  [[nodiscard]] glm::dvec3 lump_m(std::uint32_t vertex, double depth_m) const {
    glm::dvec3 at_m = place_m_[vertex] - depth_m * glm::dvec3(samples_[vertex].normal);
    for (std::size_t k = 0; k < near_[vertex].count; ++k) {
      const Near& near = near_[vertex].near[k];
      const Crease& crease = creases_[near.crease];
      at_m += std::max(0.0, depth_m * crease.slant - near.distance_m) * crease.inward;
    }
    return at_m;
  }

  /// Adds the conductances through a face of that width between the columns of two vertices.
  void add_pair(std::uint32_t a, std::uint32_t b, double width_m) {
    const physics::ConductionColumn& one = *column(a);
    const physics::ConductionColumn& other = *column(b);
    const physics::ColumnDepths& depths = heat_.depths(samples_[a].material);
    const physics::ColumnDepths& others = heat_.depths(samples_[b].material);
    const Lumps& left_a = left(a);
    const Lumps& left_b = left(b);
    // Find how much of the way leads away from a crease: across it the face keeps its width.
    const glm::dvec3 way_m = place_m_[b] - place_m_[a];
    const double length_m = glm::length(way_m);
    double across = length_m > 0.0 ? 0.0 : 1.0;
    for (const std::uint32_t v : {a, b}) {
      for (std::size_t k = 0; k < near_[v].count && length_m > 0.0; ++k) {
        const double on = glm::dot(creases_[near_[v].near[k].crease].inward, way_m) / length_m;
        across = std::max(across, on * on);
      }
    }
    Pair pair{a, b, {}};
    for (std::size_t l = 0; l < std::min(one.count, other.count); ++l) {
      const double k_a = depths.sideways_w_k[l];
      const double k_b = others.sideways_w_k[l];
      if (!(k_a + k_b > 0.0)) continue;
      const double share = across + (1.0 - across) * 0.5 * (left_a[l] + left_b[l]);
      const double apart_m =
          glm::distance(lump_m(a, depths.depth_m[l]), lump_m(b, others.depth_m[l]));
      pair.conductance_w_k[l] =
          2.0 * k_a * k_b / (k_a + k_b) * share * width_m / std::max(apart_m, kLeastWays * width_m);
    }
    pairs_.push_back(pair);
  }
  /// Returns the share of each lump that a column keeps.
  [[nodiscard]] const Lumps& left(std::uint32_t vertex) {
    const std::pair<std::uint32_t, std::uint8_t> key{samples_[vertex].material, cut_[vertex]};
    for (const auto& known : left_) {
      if (known.first == key) return known.second;
    }
    Lumps shares;
    shares.fill(1.0);
    if (cut_[vertex] != 0) {
      shares = heat_.depths(key.first).above(heat_.layers(key.first), *heat_.column(key.first),
                                             cut_frac(key.second) * thickness_m(vertex));
    }
    return left_.emplace_back(key, shares).second;
  }

  /// Finds the pairs: the ends of all edges of leaves, and vertices at the same place.
  void find_pairs() {
    struct Edge {
      std::uint32_t a = 0;
      std::uint32_t b = 0;
      double width_m = 0.0;
    };
    std::vector<Edge> edges;
    const auto linked = [this](std::uint32_t v) { return near_[v].count != 0; };
    for (std::uint32_t slot = 0; slot < mesh_.leaf_count(); ++slot) {
      const auto& leaf = mesh_.leaf(slot);
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = leaf[k];
        const std::uint32_t b = leaf[(k + 1) % 3];
        if (!linked(a) || !linked(b)) continue;
        // The face between two vertices ends at the centre of the circle around the leaf.
        const glm::dvec3& top_m = place_m_[leaf[(k + 2) % 3]];
        const glm::dvec3 to_a = place_m_[a] - top_m;
        const glm::dvec3 to_b = place_m_[b] - top_m;
        const double sine = glm::length(glm::cross(to_a, to_b));
        if (!(sine > 0.0)) continue;
        edges.push_back(
            {std::min(a, b), std::max(a, b),
             0.5 * glm::dot(to_a, to_b) / sine * glm::distance(place_m_[a], place_m_[b])});
      }
    }
    // Sum up both sides of each edge; a face of negative width conducts nothing.
    std::ranges::stable_sort(edges, {}, [](const Edge& e) { return std::pair(e.a, e.b); });
    for (std::size_t i = 0; i < edges.size();) {
      double width_m = 0.0;
      std::size_t end = i;
      while (end < edges.size() && edges[end].a == edges[i].a && edges[end].b == edges[i].b) {
        width_m += edges[end++].width_m;
      }
      if (width_m > 1e-6 * glm::distance(place_m_[edges[i].a], place_m_[edges[i].b])) {
        add_pair(edges[i].a, edges[i].b, width_m);
      }
      i = end;
    }
    // Join vertices at the same place once, by the width of a column there.
    std::ranges::sort(twins_);
    twins_.erase(std::ranges::unique(twins_).begin(), twins_.end());
    for (const auto& [a, b] : twins_) {
      if (!linked(a) || !linked(b)) continue;
      add_pair(a, b, std::sqrt(0.5 * (static_cast<double>(area_m2_[a]) + area_m2_[b])));
    }
  }

  const SurfaceInputs& in_;
  const FosterHeat& heat_;
  const RefinedMesh& mesh_;
  std::span<const SurfaceSample> samples_;
  std::vector<glm::dvec3> place_m_;  ///< by vertex, in the axes of the samples
  std::vector<float> area_m2_;
  std::vector<Crease> creases_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> twins_;
  std::vector<Neighbourhood> near_;  ///< by vertex
  std::deque<std::uint32_t> waiting_;
  std::vector<std::uint8_t> cut_;
  std::vector<bool> stands_;
  std::deque<std::pair<std::pair<std::uint32_t, std::uint8_t>, Lumps>> left_;
  std::vector<Pair> pairs_;
};

/// Appends the links of the samples of an instance.
void append(const InstanceLinks& found, std::uint32_t first, SurfaceSamples& all) {
  const std::size_t count = found.area_m2().size();
  const auto each_link = [&](const auto& visit) {
    for (const Pair& pair : found.pairs()) {
      visit(pair.a, pair.b, pair.conductance_w_k);
      visit(pair.b, pair.a, pair.conductance_w_k);
    }
  };
  std::vector<std::uint32_t> at(count + 1, 0);
  each_link([&](std::uint32_t own, std::uint32_t, const Lumps&) { ++at[own + 1]; });
  for (std::size_t v = 1; v < at.size(); ++v) at[v] += at[v - 1];
  const auto base = static_cast<std::uint32_t>(all.links.size());
  for (std::uint32_t v = 0; v < count; ++v) {
    SurfaceSample& sample = all.samples[first + v];
    sample.first_link = base + at[v];
    sample.link_count = at[v + 1] - at[v];
    if (sample.link_count == 0) continue;
    sample.cut = found.cut(v);
    sample.covered = sample.covered || found.stands(v);
  }
  all.links.resize(base + at[count]);
  each_link([&](std::uint32_t own, std::uint32_t other, const Lumps& conductance_w_k) {
    SideLink& link = all.links[base + at[own]++];
    link.sample = first + other;
    for (std::size_t l = 0; l < conductance_w_k.size(); ++l) {
      link.conductance_w_m2_k[l] =
          static_cast<float>(conductance_w_k[l] / static_cast<double>(found.area_m2()[own]));
    }
  });
}

}  // namespace

void link_columns(const SurfaceInputs& inputs, SurfaceModel& model) {
  if (inputs.heat.foster() == nullptr) return;
  const std::size_t instances = inputs.geometry.instances.size();
  std::vector<InstanceLinks> found;
  found.reserve(instances);
  for (std::uint32_t p = 0; p < instances; ++p) found.emplace_back(inputs, model, p);
  threads::parallel_parts(instances, 1, [&](std::size_t from, std::size_t to) {
    for (std::size_t p = from; p < to; ++p) found[p].find();
  });
  for (std::uint32_t p = 0; p < instances; ++p) {
    if (!found[p].pairs().empty()) append(found[p], model.first_sample[p], model.samples);
  }
}

}  // namespace emit::renderer
