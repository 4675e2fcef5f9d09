// SPDX-License-Identifier: Apache-2.0
#include "surface/run/body_surroundings.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "surface/mesh/tangents.hpp"

namespace emit::renderer {
namespace {

/// Another entity is near within this many radii of both.
constexpr double kNearRadii = 4.0;
/// A way or turn from the place of the latest look, as a share of the radius and in rad, that asks
/// for another one.
constexpr double kLookWayFrac = 0.05;
constexpr double kLookTurnRad = 0.02;
/// Share of the half extent of the box by which rays start inside of its sides. The own hull is not
/// traced, and what touches a side is still in front of the start.
constexpr double kInsideFrac = 0.02;
/// Rays from a side of a body on its way, and of one that stands.
constexpr std::size_t kFewRays = 32;
constexpr std::size_t kManyRays = 192;
static_assert(kFewRays % CasterRays::kMaxRays == 0 && kManyRays % CasterRays::kMaxRays == 0);

template <std::size_t count>
using Directions = std::array<glm::vec3, count>;

/// Directions around +z, spread evenly by the cosine on a spiral.
template <std::size_t count>
Directions<count> cosine_directions() noexcept {
  constexpr double kGolden = 0.6180339887498949;
  Directions<count> out;
  for (std::size_t i = 0; i < count; ++i) {
    const double share = (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    const double r = std::sqrt(share);
    const double angle = 2.0 * physics::kPi * kGolden * static_cast<double>(i);
    out[i] = {static_cast<float>(r * std::cos(angle)), static_cast<float>(r * std::sin(angle)),
              static_cast<float>(std::sqrt(1.0 - share))};
  }
  return out;
}

}  // namespace

BodySurroundings::BodySurroundings(const SurfaceGeometry& geometry, const SurfaceModel& model,
                                   std::vector<EntityAnchor> anchors, const Grid& grid)
    : geometry_(geometry),
      model_(model),
      anchors_(std::move(anchors)),
      boxes_m_(geometry.entity_boxes_m()),
      grid_(grid),
      turn_ns_(std::max<std::int64_t>(1, grid.step_ns / kTurns)),
      next_turn_(std::max<std::int64_t>(0, grid.now_ns - grid.start_ns) / turn_ns_ + 1),
      views_(anchors_.size()),
      stands_(anchors_.size()),
      looks_(anchors_.size()),
      poses_(anchors_.size()),
      placements_(anchors_.size()),
      traced_(anchors_.size()) {
  for (EntityPlacement& place : traced_) place.on = false;
}

void BodySurroundings::run(std::int64_t until_ns, std::span<const PoseHistory> entities,
                           std::span<const SampleOutput> outputs) noexcept {
  for (;; ++next_turn_) {
    const std::int64_t at_ns = grid_.start_ns + next_turn_ * turn_ns_;
    if (at_ns > until_ns) return;
    if (!place(at_ns, entities)) continue;
    const auto turn = static_cast<std::size_t>(next_turn_ % kTurns);
    for (std::size_t m = turn; m < views_.size(); m += static_cast<std::size_t>(kTurns)) {
      if (wants_look(m, at_ns)) look(m, outputs);
    }
  }
}

bool BodySurroundings::place(std::int64_t at_ns, std::span<const PoseHistory> entities) noexcept {
  any_moved_ = false;
  for (std::size_t m = 0; m < entities.size(); ++m) {
    const TrajectoryState state = entities[m].at(at_ns);
    poses_[m] = state.pose;
    placements_[m] = placement_of(state, geometry_.origin_world_m());
    stands_[m] = stand_of(state.pose, anchors_[m]);
    any_moved_ = any_moved_ || stands_[m].moved_frac > 0.0F;
  }
  return any_moved_;
}

bool BodySurroundings::wants_look(std::size_t entity, std::int64_t at_ns) noexcept {
  Look& last = looks_[entity];
  BodyView& view = views_[entity];
  if (!placements_[entity].on) {
    view.known = false;
    return false;
  }
  // Choose the entities near it, and sum up where those are that have moved.
  const auto is_near = [&](std::size_t m) {
    const double reach_m = kNearRadii * (anchors_[m].radius_m + anchors_[entity].radius_m);
    return m != entity && placements_[m].on &&
           glm::distance(poses_[m].position_world_m, poses_[entity].position_world_m) < reach_m;
  };
  bool moved_near = false;
  glm::dvec3 near_m(0.0);
  for (std::size_t m = 0; m < traced_.size(); ++m) {
    traced_[m].on = false;
    if (!is_near(m)) continue;
    traced_[m] = placements_[m];
    if (stands_[m].moved_frac == 0.0F) continue;
    moved_near = true;
    near_m += poses_[m].position_world_m;
  }
  if (stands_[entity].moved_frac == 0.0F && !moved_near) {
    view.known = false;
    return false;
  }
  // Look with few rays after a move of either, with many once both stand, and with many again after
  // an interval: what stands there changes too.
  const double way_m = kLookWayFrac * std::max(anchors_[entity].radius_m, 0.01);
  const bool stands = view.known &&
                      physics::close(poses_[entity], last.pose, way_m, kLookTurnRad) &&
                      glm::distance(near_m, last.near_m) < way_m;
  if (stands && last.fine && at_ns - last.at_ns < grid_.interval_ns) return false;
  last = {at_ns, poses_[entity], stands, near_m};
  return true;
}

void BodySurroundings::look(std::size_t entity, std::span<const SampleOutput> outputs) noexcept {
  static const Directions<kFewRays> few = cosine_directions<kFewRays>();
  static const Directions<kManyRays> many = cosine_directions<kManyRays>();
  const std::span<const glm::vec3> directions =
      looks_[entity].fine ? std::span<const glm::vec3>(many) : std::span<const glm::vec3>(few);
  const EntityPlacement& own = placements_[entity];
  const scene::Aabb& box_m = boxes_m_[entity];
  const glm::dvec3 centre_m = 0.5 * (box_m.min_m + box_m.max_m);
  BodyView& view = views_[entity];
  view.known = true;
  for (std::size_t s = 0; s < view.sides.size(); ++s) {
    const auto axis = static_cast<glm::length_t>(s % 3);
    const double sign = s < 3 ? 1.0 : -1.0;
    glm::dvec3 start_m = centre_m;
    start_m[axis] += sign * (1.0 - kInsideFrac) * 0.5 * (box_m.max_m[axis] - box_m.min_m[axis]);
    glm::vec3 outward(0.0F);
    outward[axis] = static_cast<float>(sign);
    view.sides[s] = look_from(own.rel_from_body * glm::vec3(start_m) + own.position_m,
                              own.rel_from_body * outward, directions, outputs);
  }
}

SideView BodySurroundings::look_from(const glm::vec3& from_m, const glm::vec3& normal,
                                     std::span<const glm::vec3> directions,
                                     std::span<const SampleOutput> outputs) const noexcept {
  const Tangents tangents = tangents_of(normal);
  const float ray_frac = 1.0F / static_cast<float>(directions.size());
  SideView side;
  for (std::size_t first = 0; first < directions.size(); first += CasterRays::kMaxRays) {
    std::array<CasterRay, CasterRays::kMaxRays> rays;
    std::array<CasterHit, CasterRays::kMaxRays> hits;
    for (std::size_t k = 0; k < rays.size(); ++k) {
      const glm::vec3& local = directions[first + k];
      rays[k] = {from_m, local.x * tangents.u + local.y * tangents.v + local.z * normal};
    }
    const std::uint32_t met = geometry_.places().first_hits(rays, {true, traced_}, hits);
    for (std::size_t k = 0; k < rays.size(); ++k) {
      const bool up = rays[k].direction.z >= 0.0F;
      if (up) side.up_frac += ray_frac;
      if (((met >> k) & 1U) != 0U) add(hits[k], up, ray_frac, outputs, side);
    }
  }
  return side;
}

void BodySurroundings::add(const CasterHit& hit, bool up, float ray_frac,
                           std::span<const SampleOutput> outputs, SideView& side) const noexcept {
  const scene::Instance& instance = geometry_.geometry().instances[hit.instance];
  const std::int32_t entity = geometry_.entity_of_object()[instance.object];
  const bool moved = entity >= 0 && stands_[static_cast<std::size_t>(entity)].moved_frac > 0.0F;
  SideView::Met& met =
      moved ? (up ? side.moved_up : side.moved_down) : (up ? side.still_up : side.still_down);
  met.frac += ray_frac;
  // Interpolate between the samples around the place, on the side that is seen.
  const RefinedMesh::Place at = model_.meshes[instance.mesh].locate(hit.triangle, hit.barycentric);
  for (glm::length_t k = 0; k < 3; ++k) {
    std::uint32_t sample =
        model_.first_sample[hit.instance] + at.vertex[static_cast<std::size_t>(k)];
    const std::uint32_t behind = model_.samples.samples[sample].other_side;
    if (!hit.front && behind != kNoSample) sample = behind;
    met.longwave_w_m2 += ray_frac * at.weight[k] * outputs[sample].longwave_out_w_m2;
    met.shortwave_w_m2 += ray_frac * at.weight[k] * outputs[sample].shortwave_out_w_m2;
  }
}

}  // namespace emit::renderer
