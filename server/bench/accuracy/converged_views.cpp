// SPDX-License-Identifier: Apache-2.0
#include "bench/accuracy/converged_views.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "emit/physics/check.hpp"

namespace emit::tool {
namespace {

/// Longest time between two traced nodes. The sun's disc moves by half its width in 64 s, so an
/// occluder is seen at one of two such nodes.
constexpr std::int64_t kLookNs = 70'000'000'000;
/// Length of a step while an entity moves.
constexpr std::int64_t kMovingStepNs = 500'000'000;
/// Number of first rays over the disc. All rays are traced where these do not agree.
constexpr std::uint32_t kFirstRays = 16;
/// Distance beyond which a moving entity leaves a point's view of the sky unchanged. A nearer one
/// may move and turn by the two values below.
constexpr double kEntityReachM = 25.0;
constexpr double kEntityShiftM = 0.25;
constexpr double kEntityTurnCos = 0.9998;  // of half the angle

bool same_place(const physics::Pose& a, const physics::Pose& b, double shift_m, double turn_cos) {
  return glm::distance(a.position_world_m, b.position_world_m) <= shift_m &&
         std::abs(glm::dot(a.world_from_body, b.world_from_body)) >= turn_cos;
}

}  // namespace

ConvergedViews::ConvergedViews(const reference::RayScene& scene, std::int64_t start_ns,
                               std::int64_t end_ns, std::span<const std::int64_t> extra_ns,
                               const Options& options)
    : scene_(scene), options_(options) {
  choose_nodes(start_ns, end_ns, extra_ns);
  instants_.reserve(nodes_ns_.size());
  for (const std::int64_t t : nodes_ns_) instants_.push_back(scene_.at(t));
  // Every node is traced while something moves.
  const std::int64_t step_ns = std::max<std::int64_t>(1, (end_ns - start_ns) / options_.steps);
  coarse_.push_back(0);
  for (std::size_t i = 1; i < nodes_ns_.size(); ++i) {
    const bool last = i + 1 == nodes_ns_.size();
    const bool fine = nodes_ns_[i] - nodes_ns_[i - 1] < std::min(step_ns, 2 * kMovingStepNs);
    if (last || fine || nodes_ns_[i + 1] - nodes_ns_[coarse_[coarse_.size() - 1]] > kLookNs ||
        nodes_ns_[i + 1] - nodes_ns_[i] < std::min(step_ns, 2 * kMovingStepNs)) {
      coarse_.push_back(i);
    }
  }
}

bool ConvergedViews::moves(std::int64_t from_ns, std::int64_t to_ns) const {
  const auto entities = static_cast<std::uint32_t>(scene_.desc().entities.size());
  if (entities == 0) return false;
  const reference::SceneInstant here = scene_.at(from_ns);
  for (int part = 1; part <= 4; ++part) {
    const reference::SceneInstant there = scene_.at(from_ns + (to_ns - from_ns) * part / 4);
    for (std::uint32_t m = 0; m < entities; ++m) {
      if (here.entity_on(m) != there.entity_on(m) ||
          !same_place(here.entity_pose(m), there.entity_pose(m), 1e-3, 1.0 - 1e-9)) {
        return true;
      }
    }
  }
  return false;
}

void ConvergedViews::choose_nodes(std::int64_t start_ns, std::int64_t end_ns,
                                  std::span<const std::int64_t> extra_ns) {
  const std::int64_t length_ns = end_ns - start_ns;
  const auto steps = static_cast<std::int64_t>(options_.steps);
  for (std::int64_t i = 0; i < steps; ++i) {
    const std::int64_t from_ns = start_ns + length_ns / steps * i + length_ns % steps * i / steps;
    const std::int64_t next = i + 1;
    const std::int64_t to_ns =
        start_ns + length_ns / steps * next + length_ns % steps * next / steps;
    nodes_ns_.push_back(from_ns);
    if (!moves(from_ns, to_ns)) continue;
    for (std::int64_t t = from_ns + kMovingStepNs; t < to_ns; t += kMovingStepNs) {
      nodes_ns_.push_back(t);
    }
  }
  nodes_ns_.push_back(end_ns);
  for (const std::int64_t t : extra_ns) {
    if (t > start_ns && t < end_ns) nodes_ns_.push_back(t);
  }
  std::sort(nodes_ns_.begin(), nodes_ns_.end());
  nodes_ns_.erase(std::unique(nodes_ns_.begin(), nodes_ns_.end()), nodes_ns_.end());
}

ConvergedViews::Placed ConvergedViews::placed(const PixelSurface& point, std::size_t node) const {
  Placed out;
  out.point.position_world_m = point.position_m;
  out.point.normal = point.shading_normal;
  out.point.tolerance_m = 1e-9 * (1.0 + glm::length(point.position_m));
  if (point.entity == reference::kNoEntity) return out;
  const physics::Pose& now = instants_.back().entity_pose(point.entity);
  const physics::Pose& then = instants_[node].entity_pose(point.entity);
  const glm::dquat then_from_now = then.world_from_body * glm::conjugate(now.world_from_body);
  out.point.position_world_m =
      then.position_world_m + then_from_now * (point.position_m - now.position_world_m);
  out.point.normal = then_from_now * point.shading_normal;
  out.absent = !instants_[node].entity_on(point.entity);
  return out;
}

double ConvergedViews::sun_frac(const PixelSurface& point, const ConvergedModel& model,
                                std::size_t node) const {
  const glm::dvec3& sun_w_m2 = model.sun_w_m2(node);
  const Placed here = placed(point, node);
  if (!(glm::dot(sun_w_m2, here.point.normal) > 0.0)) return 0.0;
  if (here.absent) return 1.0;
  const glm::dvec3 to_sun = glm::normalize(sun_w_m2);
  reference::SunQuery query;
  query.rays = std::min(kFirstRays, options_.sun_rays);
  const double seen = instants_[node].sun_visible_frac(here.point, to_sun, query).value_frac;
  if (seen == 0.0 || seen == 1.0) return seen;
  query.rays = options_.sun_rays;
  return instants_[node].sun_visible_frac(here.point, to_sun, query).value_frac;
}

/// Fills the nodes between two known ones. All are alike where those see all of the sun or nothing
/// of it.
void ConvergedViews::fill_sun(const PixelSurface& point, const ConvergedModel& model,
                              std::size_t first, std::size_t last,
                              std::span<PointView> view) const {
  if (last - first < 2) return;
  const double from = view[first].sun_frac;
  const double to = view[last].sun_frac;
  if (from == to && (from == 0.0 || from == 1.0)) {
    for (std::size_t i = first + 1; i < last; ++i) view[i].sun_frac = from;
    return;
  }
  const std::size_t middle = first + (last - first) / 2;
  view[middle].sun_frac = sun_frac(point, model, middle);
  fill_sun(point, model, first, middle, view);
  fill_sun(point, model, middle, last, view);
}

bool ConvergedViews::same_surroundings(const PixelSurface& point, const glm::dvec3& position_m,
                                       std::size_t a, std::size_t b) const {
  for (std::uint32_t m = 0; m < scene_.desc().entities.size(); ++m) {
    const physics::Pose& before = instants_[a].entity_pose(m);
    const physics::Pose& after = instants_[b].entity_pose(m);
    const bool near = m == point.entity ||
                      std::min(glm::distance(before.position_world_m, position_m),
                               glm::distance(after.position_world_m, position_m)) < kEntityReachM;
    if (!near) continue;
    if (instants_[a].entity_on(m) != instants_[b].entity_on(m) ||
        !same_place(before, after, kEntityShiftM, kEntityTurnCos)) {
      return false;
    }
  }
  return true;
}

void ConvergedViews::fill_sky(const PixelSurface& point, std::span<PointView> view) const {
  std::size_t looked = 0;
  for (std::size_t i = 0; i < view.size(); ++i) {
    const Placed here = placed(point, i);
    view[i].normal = here.point.normal;
    if (i > 0 && same_surroundings(point, here.point.position_world_m, looked, i)) {
      view[i].sky_frac = view[looked].sky_frac;
      continue;
    }
    looked = i;
    if (here.absent) {
      const double open_frac = 0.5 * (1.0 + here.point.normal.z);
      view[i].sky_frac = options_.uniform_sky ? 0.5 * open_frac : open_frac;
      continue;
    }
    const reference::SkyView sky = instants_[i].sky_view(here.point, options_.sky_rays);
    view[i].sky_frac =
        options_.uniform_sky ? sky.sky_uniform.value_frac : sky.sky_cosine.value_frac;
  }
}

void ConvergedViews::see(const PixelSurface& point, const ConvergedModel& model,
                         std::span<PointView> view) const {
  EMIT_CHECK_OP(view.size(), ==, nodes_ns_.size());
  EMIT_CHECK_OP(model.node_count(), ==, nodes_ns_.size());
  fill_sky(point, view);
  for (const std::size_t node : coarse_) view[node].sun_frac = sun_frac(point, model, node);
  for (std::size_t i = 1; i < coarse_.size(); ++i) {
    fill_sun(point, model, coarse_[i - 1], coarse_[i], view);
  }
}

}  // namespace emit::tool
