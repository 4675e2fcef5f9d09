// SPDX-License-Identifier: Apache-2.0
#include "points/point_views.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <utility>

namespace emit::reference {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;
/// Times between samples of the visibility, which is linear between them. If the sun's share
/// changes, the interval is halved down to the shortest one.
constexpr std::int64_t kStaticStepNs = 60 * kSecondNs;
/// The same in the time before the scenario's own history, in which nothing moves and whose edges
/// have faded.
constexpr std::int64_t kSpinUpStepNs = 600 * kSecondNs;
constexpr std::int64_t kShortestSpinUpNs = 75 * kSecondNs;
constexpr std::int64_t kMovingStepNs = 4 * kSecondNs;
constexpr std::int64_t kShortestStaticNs = 4 * kSecondNs;
constexpr std::int64_t kShortestMovingNs = kSecondNs / 2;
constexpr double kEvenFrac = 0.02;
/// Distance beyond which an entity does not change a point's view.
constexpr double kEntityReachM = 25.0;
/// Changes of place and attitude (cosine of half the angle) that leave a view as it was.
constexpr double kSamePlaceM = 0.5;
constexpr double kSameAttitude = 0.9998;

/// Returns true if an entity has the same pose at two instants, within a tolerance.
bool same_pose(const physics::Pose& a, const physics::Pose& b, double place_m, double attitude) {
  return glm::distance(a.position_world_m, b.position_world_m) < place_m &&
         std::abs(glm::dot(a.world_from_body, b.world_from_body)) > attitude;
}

/// Returns true if an entity moves or switches between two instants.
bool moves(std::size_t entities, const SceneInstant& a, const SceneInstant& b) {
  for (std::uint32_t m = 0; m < entities; ++m) {
    if (a.entity_on(m) != b.entity_on(m)) return true;
    if (!same_pose(a.entity_pose(m), b.entity_pose(m), 1e-3, 1.0 - 1e-9)) return true;
  }
  return false;
}

/// Entities as they stood when a point looked last.
class NearEntities {
 public:
  explicit NearEntities(std::size_t entities) : poses_(entities), on_(entities, 0) {}

  void remember(const SceneInstant& instant) {
    for (std::uint32_t m = 0; m < poses_.size(); ++m) {
      poses_[m] = instant.entity_pose(m);
      on_[m] = instant.entity_on(m) ? 1 : 0;
    }
  }
  /// Returns true if none near the point has moved or switched since. `own`: entity of the point.
  [[nodiscard]] bool same(const SceneInstant& instant, const glm::dvec3& point_m,
                          std::uint32_t own) const {
    for (std::uint32_t m = 0; m < poses_.size(); ++m) {
      const physics::Pose& pose = instant.entity_pose(m);
      const double nearest_m = std::min(glm::distance(pose.position_world_m, point_m),
                                        glm::distance(poses_[m].position_world_m, point_m));
      if (m != own && !(nearest_m < kEntityReachM)) continue;
      if (on_[m] != (instant.entity_on(m) ? 1 : 0)) return false;
      if (!same_pose(pose, poses_[m], kSamePlaceM, kSameAttitude)) return false;
    }
    return true;
  }

 private:
  std::vector<physics::Pose> poses_;
  std::vector<char> on_;  ///< 1: on
};

/// The views of one point over its history. The share of the sky is remembered from one look to the
/// next, so that the order of the looks is part of the result. Thread: one owner.
class PointViews {
 public:
  /// The arguments outlive the object.
  PointViews(const SurfaceClimate& climate, const SolvePoint& point, std::uint32_t rays,
             const SceneNodes& nodes)
      : climate_(climate),
        point_(point),
        rays_(rays),
        nodes_(nodes),
        carried_(point, nodes.instants.back()),
        near_(nodes.scene.desc().entities.size()) {}

  /// Samples at all nodes and refines between them.
  std::vector<ViewSample> run() {
    const auto& times_ns = nodes_.times_ns;
    double last_sun = 0.0;
    for (std::size_t i = 0; i < times_ns.size(); ++i) {
      const auto [sample, sun] = look(times_ns[i], nodes_.instants[i]);
      if (i > 0) {
        const std::int64_t step = times_ns[i] - times_ns[i - 1];
        const bool moving =
            step < kStaticStepNs && (climate_.clouds() == nullptr || step <= kMovingStepNs);
        refine(times_ns[i - 1], last_sun, times_ns[i], sun,
               moving                 ? kShortestMovingNs
               : step > kStaticStepNs ? kShortestSpinUpNs
                                      : kShortestStaticNs);
      }
      out_.push_back(sample);
      last_sun = sun;
    }
    return std::move(out_);
  }

 private:
  /// Returns the share of the sky. It is traced again only if an entity near the point has moved.
  double sky_frac(const SceneInstant& instant, const SurfacePoint& p) {
    if (last_sky_ < 0.0 || !near_.same(instant, p.position_world_m, point_.entity)) {
      last_sky_ = instant.sky_view(p, rays_).sky_cosine.value_frac;
      near_.remember(instant);
    }
    return last_sky_;
  }

  /// Samples the view at one instant. The second value is the visible share of the sun.
  std::pair<ViewSample, double> look(std::int64_t t, const SceneInstant& instant) {
    ViewSample sample;
    sample.time_ns = t;
    const ClimateNode now = climate_.at(t);
    const glm::dvec3 to_sun = glm::normalize(now.to_sun);
    const SurfacePoint p = carried_.at(instant);
    // An entity that is switched off stands in the open.
    const bool absent = point_.entity != kNoEntity && !instant.entity_on(point_.entity);
    const double cosine = glm::dot(p.normal, to_sun);
    double sun = 0.0;
    if (cosine > 0.0 && now.direct_normal_w_m2 > 0.0) {
      sun = absent ? 1.0 : instant.sun_visible_frac_clipped(p, to_sun).value_frac;
      sun *= climate_.cloud_sun(now, p.position_world_m);
    }
    sample.sky_frac = absent ? 0.5 * (1.0 + p.normal.z) : sky_frac(instant, p);
    if (point_.entity == kNoEntity) {
      sample.sun_frac = sun;
    } else {
      // Pass the sunlight on an entity as a flux: the solver knows only one direction of the face,
      // but the entity turns.
      sample.sun_frac = 0.0;
      sample.scene_shortwave_w_m2 = now.direct_normal_w_m2 * sun * std::max(0.0, cosine);
    }
    return {sample, sun};
  }

  /// Halves an interval until the sun's share is even over it, and adds the samples inside it.
  void refine(std::int64_t from, double sun_from, std::int64_t to, double sun_to,
              std::int64_t shortest) {
    if (to - from <= shortest || std::abs(sun_to - sun_from) <= kEvenFrac) return;
    const std::int64_t middle = from + (to - from) / 2;
    const auto [sample, sun] = look(middle, nodes_.scene.at(middle));
    refine(from, sun_from, middle, sun, shortest);
    out_.push_back(sample);
    refine(middle, sun, to, sun_to, shortest);
  }

  const SurfaceClimate& climate_;
  const SolvePoint& point_;
  std::uint32_t rays_;
  SceneNodes nodes_;
  CarriedPoint carried_;
  NearEntities near_;
  double last_sky_ = -1.0;  ///< -1: not traced yet
  std::vector<ViewSample> out_;
};

}  // namespace

CarriedPoint::CarriedPoint(const SolvePoint& point, const SceneInstant& now)
    : entity_(point.entity), position_m_(point.position_world_m), normal_(point.normal) {
  if (entity_ == kNoEntity) return;
  // Find the point in the frame of its entity, so that it can be carried back in time with it.
  const physics::Pose& pose = now.entity_pose(entity_);
  const glm::dquat back = glm::conjugate(pose.world_from_body);
  position_m_ = back * (position_m_ - pose.position_world_m);
  normal_ = back * normal_;
}

SurfacePoint CarriedPoint::at(const SceneInstant& instant) const {
  if (entity_ == kNoEntity) return {position_m_, normal_, 0.0};
  const physics::Pose& pose = instant.entity_pose(entity_);
  return {pose.position_world_m + pose.world_from_body * position_m_,
          pose.world_from_body * normal_, 1e-9};
}

std::vector<std::int64_t> view_nodes(const RayScene& scene, const SurfaceClimate& climate,
                                     std::int64_t dense_from_ns, std::int64_t until_ns) {
  std::int64_t t = climate.history_start_ns();
  std::vector<std::int64_t> nodes_ns{t};
  while (t < std::min(until_ns, dense_from_ns)) {
    // The last step may be longer than the others, so that none looks like one of the other kinds.
    const std::int64_t left = std::min(until_ns, dense_from_ns) - t;
    t += left < 2 * kSpinUpStepNs ? left : kSpinUpStepNs;
    nodes_ns.push_back(t);
  }
  // Clouds pass within that time. Steps of one kind are told from those of others by their length.
  std::int64_t static_ns = kStaticStepNs;
  if (climate.clouds() != nullptr) {
    static_ns = std::clamp<std::int64_t>(std::llround(1e9 * climate.clouds()->step_s()),
                                         kMovingStepNs + 1, kStaticStepNs);
  }
  while (t < until_ns) {
    const std::int64_t next = std::min(until_ns, t + static_ns);
    // Look in the middle as well: a keyframe between the ends moves too.
    const SceneInstant here = scene.at(t);
    bool moving = false;
    for (int part = 1; part <= 4 && !moving; ++part) {
      moving = moves(scene.desc().entities.size(), here, scene.at(t + (next - t) * part / 4));
    }
    t = moving ? std::min(next, t + kMovingStepNs) : next;
    nodes_ns.push_back(t);
  }
  return nodes_ns;
}

std::vector<ViewSample> point_views(const SurfaceClimate& climate, const SolvePoint& point,
                                    std::uint32_t rays, const SceneNodes& nodes) {
  return PointViews(climate, point, rays, nodes).run();
}

std::vector<ViewEpoch> view_epochs(const SolvePoint& point, const SceneNodes& nodes) {
  const auto& instants = nodes.instants;
  const CarriedPoint carried(point, instants.back());
  NearEntities near(nodes.scene.desc().entities.size());
  near.remember(instants.front());
  std::vector<ViewEpoch> out{{}};
  for (std::size_t i = 1; i < instants.size(); ++i) {
    if (!near.same(instants[i], carried.at(instants[i]).position_world_m, point.entity)) {
      near.remember(instants[i]);
      out.push_back({.first = i});
    }
    out.back().last = i;
  }
  for (ViewEpoch& epoch : out) {
    const std::size_t before = epoch.first > 0 ? epoch.first - 1 : 0;
    const std::size_t after = std::min(epoch.last + 1, instants.size() - 1);
    epoch.brief = nodes.times_ns[after] - nodes.times_ns[epoch.first] < kStaticStepNs;
    if (point.entity == kNoEntity) continue;
    const physics::Pose& own = instants[epoch.first].entity_pose(point.entity);
    epoch.own_moves =
        !same_pose(own, instants[before].entity_pose(point.entity), 1e-2, 1.0 - 1e-9) ||
        !same_pose(own, instants[after].entity_pose(point.entity), 1e-2, 1.0 - 1e-9);
  }
  return out;
}

}  // namespace emit::reference
