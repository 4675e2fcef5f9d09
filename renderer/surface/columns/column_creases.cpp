// SPDX-License-Identifier: Apache-2.0
// Creases of a body, feet of its walls, and the vertices near them.
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <tuple>

#include "surface/columns/instance_columns.hpp"
#include "surface/mesh/refined_mesh_edges.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer::columns {
namespace {

/// Cosine between the normals of two faces above which the edge between them is no crease: the
/// facets of a round side.
constexpr double kFlatCos = 0.9;
/// Greatest distance from an edge per depth at which the other face takes over: that of an edge of
/// 40 degrees.
constexpr double kMaxSlant = 2.7;
/// Cosine between the directions away from two creases above which they are one edge.
constexpr double kSameCos = 0.9;

}  // namespace

/// Distance from a crease that goes on by `beyond_m` at both ends.
double distance_m(const Crease& crease, const glm::dvec3& at_m, double beyond_m) {
  const glm::dvec3 way_m = crease.end_m - crease.begin_m;
  const double length_m = glm::length(way_m);
  const double along_m = glm::dot(at_m - crease.begin_m, way_m) / length_m;
  const double nearest_m = std::clamp(along_m, -beyond_m, length_m + beyond_m);
  return glm::distance(at_m, crease.begin_m + nearest_m / length_m * way_m);
}

glm::dvec3 InstanceColumns::inward(const Side& side) const {
  const glm::dvec3 edge = glm::normalize(place_m_[side.at_high] - place_m_[side.at_low]);
  const glm::dvec3 way = centre_m(side.slot()) - place_m_[side.at_low];
  const glm::dvec3 out = way - glm::dot(way, edge) * edge;
  const double length = glm::length(out);
  return length > 0.0 ? out / length : glm::dvec3(0.0);
}

std::optional<CasterHit> InstanceColumns::ground_of(std::uint32_t beside,
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

void InstanceColumns::find_creases() {
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

void InstanceColumns::join(const Side& one, const Side& other) {
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
  const double slant =
      std::min(kMaxSlant, std::sqrt(std::max(0.0, (1.0 - cosine) / std::max(1.0 + cosine, 1e-3))));
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

void InstanceColumns::end_at(const Side& side) {
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

void InstanceColumns::offer(std::uint32_t vertex, std::uint32_t crease) {
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

void InstanceColumns::spread_creases() {
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

void InstanceColumns::find_near() {
  if (!waiting_.empty()) spread_creases();
  find_opposites();
  const std::size_t count = mesh_.vertices().size();
  column_of_.assign(count, kNone);
  for (std::uint32_t v = 0; v < count; ++v) {
    if (stands_near(v)) {
      standing_.push_back(v);
      continue;
    }
    if (near_[v].count == 0 && opposite_[v].slot == kNone && !at_foot(v)) continue;
    column_of_[v] = static_cast<std::uint32_t>(vertices_.size());
    vertices_.push_back(v);
  }
  measured_.resize(vertices_.size());
}

}  // namespace emit::renderer::columns
