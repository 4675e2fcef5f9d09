// SPDX-License-Identifier: Apache-2.0
#include "solve_points.hpp"
#include "emit/threads/parallel.hpp"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <map>
#include <utility>

namespace emit::reference {
namespace {

using physics::Result;

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
/// Distance beyond which an entity does not change a point's view of the sky.
constexpr double kEntityReachM = 25.0;

/// The views of one point over its history: at the nodes, and between them where the sun's share
/// changes. The share of the sky is remembered from one look to the next, so that the order of the
/// looks is part of the result. Thread: one owner.
class PointViews {
 public:
  /// The arguments outlive the object. `sim_time_ns`: instant at which the point is where it says.
  PointViews(const RayScene& scene, const SurfaceClimate& climate, const SolvePoint& point,
             std::uint32_t rays, std::int64_t sim_time_ns)
      : scene_(scene),
        climate_(climate),
        point_(point),
        rays_(rays),
        last_poses_(scene.desc().entities.size()),
        last_on_(last_poses_.size(), 0) {
    carry_back(sim_time_ns);
  }

  /// Samples at all nodes and refines between them. `instants`: the scene at the nodes.
  std::vector<ViewSample> run(std::span<const std::int64_t> nodes_ns,
                              std::span<const SceneInstant> instants) {
    double last_sun = 0.0;
    for (std::size_t i = 0; i < nodes_ns.size(); ++i) {
      const auto [sample, sun] = look(nodes_ns[i], instants[i]);
      if (i > 0) {
        const std::int64_t step = nodes_ns[i] - nodes_ns[i - 1];
        refine(nodes_ns[i - 1], last_sun, nodes_ns[i], sun,
               step < kStaticStepNs   ? kShortestMovingNs
               : step > kStaticStepNs ? kShortestSpinUpNs
                                      : kShortestStaticNs);
      }
      out_.push_back(sample);
      last_sun = sun;
    }
    return std::move(out_);
  }

 private:
  /// Finds the point in the frame of its entity, so that it can be carried back in time with it.
  void carry_back(std::int64_t sim_time_ns) {
    if (point_.entity == kNoEntity) return;
    const SceneInstant now = scene_.at(sim_time_ns);
    const physics::Pose& pose = now.entity_pose(point_.entity);
    const glm::dquat back = glm::conjugate(pose.world_from_body);
    body_m_ = back * (point_.position_world_m - pose.position_world_m);
    body_normal_ = back * point_.normal;
  }

  SurfacePoint place_at(const SceneInstant& instant) const {
    SurfacePoint p{point_.position_world_m, point_.normal, 0.0};
    if (point_.entity != kNoEntity) {
      const physics::Pose& pose = instant.entity_pose(point_.entity);
      p.position_world_m = pose.position_world_m + pose.world_from_body * body_m_;
      p.normal = pose.world_from_body * body_normal_;
      p.tolerance_m = 1e-9;
    }
    return p;
  }

  /// Returns the share of the sky. It is traced again only if an entity near the point has moved.
  double sky_frac(const SceneInstant& instant, const SurfacePoint& p) {
    bool same = last_sky_ >= 0.0;
    for (std::uint32_t m = 0; m < last_poses_.size(); ++m) {
      const physics::Pose& pose = instant.entity_pose(m);
      const bool near =
          m == point_.entity || std::min(glm::distance(pose.position_world_m, p.position_world_m),
                                         glm::distance(last_poses_[m].position_world_m,
                                                       p.position_world_m)) < kEntityReachM;
      if (!near) continue;
      same = same && last_on_[m] == (instant.entity_on(m) ? 1 : 0) &&
             glm::distance(pose.position_world_m, last_poses_[m].position_world_m) < 0.5 &&
             std::abs(glm::dot(pose.world_from_body, last_poses_[m].world_from_body)) > 0.9998;
    }
    if (!same) {
      last_sky_ = instant.sky_view(p, rays_).sky_cosine.value_frac;
      for (std::uint32_t m = 0; m < last_poses_.size(); ++m) {
        last_poses_[m] = instant.entity_pose(m);
        last_on_[m] = instant.entity_on(m) ? 1 : 0;
      }
    }
    return last_sky_;
  }

  /// Samples the view at one instant. The second value is the visible share of the sun.
  std::pair<ViewSample, double> look(std::int64_t t, const SceneInstant& instant) {
    ViewSample sample;
    sample.time_ns = t;
    const ClimateNode now = climate_.at(t);
    const glm::dvec3 to_sun = glm::normalize(now.to_sun);
    const SurfacePoint p = place_at(instant);
    // An entity that is switched off stands in the open.
    const bool absent = point_.entity != kNoEntity && !instant.entity_on(point_.entity);
    const double cosine = glm::dot(p.normal, to_sun);
    double sun = 0.0;
    if (cosine > 0.0 && now.direct_normal_w_m2 > 0.0) {
      sun = absent ? 1.0 : instant.sun_visible_frac_clipped(p, to_sun).value_frac;
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
    const auto [sample, sun] = look(middle, scene_.at(middle));
    refine(from, sun_from, middle, sun, shortest);
    out_.push_back(sample);
    refine(middle, sun, to, sun_to, shortest);
  }

  const RayScene& scene_;
  const SurfaceClimate& climate_;
  const SolvePoint& point_;
  std::uint32_t rays_;
  glm::dvec3 body_m_{0.0};                 ///< in the frame of the point's entity
  glm::dvec3 body_normal_{0.0};            ///< likewise
  double last_sky_ = -1.0;                 ///< -1: not traced yet
  std::vector<physics::Pose> last_poses_;  ///< of the entities, when the sky was traced
  std::vector<char> last_on_;              ///< likewise, 1: on
  std::vector<ViewSample> out_;
};

}  // namespace

PointHistories::PointHistories(const scene::ScenarioDesc& scenario,
                               const scene::SceneGeometry& geometry, const RayScene& scene,
                               const SurfaceClimate& climate, std::uint32_t rays,
                               std::int64_t dense_from_ns)
    : scenario_(scenario),
      geometry_(geometry),
      scene_(scene),
      climate_(climate),
      rays_(rays),
      dense_from_ns_(dense_from_ns) {}

/// Returns true if an entity moves or switches between two instants.
bool PointHistories::moves(const SceneInstant& a, const SceneInstant& b) const {
  for (std::uint32_t m = 0; m < scene_.desc().entities.size(); ++m) {
    if (a.entity_on(m) != b.entity_on(m)) return true;
    const physics::Pose& pa = a.entity_pose(m);
    const physics::Pose& pb = b.entity_pose(m);
    if (glm::distance(pa.position_world_m, pb.position_world_m) > 1e-3 ||
        std::abs(glm::dot(pa.world_from_body, pb.world_from_body)) < 1.0 - 1e-9) {
      return true;
    }
  }
  return false;
}

/// Chooses the instants at which every point is sampled. They are close together while anything
/// moves.
void PointHistories::choose_nodes(std::int64_t until_ns,
                                  std::vector<std::int64_t>& nodes_ns) const {
  std::int64_t t = climate_.history_start_ns();
  nodes_ns = {t};
  while (t < std::min(until_ns, dense_from_ns_)) {
    // The last step may be longer than the others, so that none looks like one of the other kinds.
    const std::int64_t left = std::min(until_ns, dense_from_ns_) - t;
    t += left < 2 * kSpinUpStepNs ? left : kSpinUpStepNs;
    nodes_ns.push_back(t);
  }
  while (t < until_ns) {
    const std::int64_t next = std::min(until_ns, t + kStaticStepNs);
    // Look in the middle as well: a keyframe between the ends moves too.
    const SceneInstant here = scene_.at(t);
    bool moving = false;
    for (int part = 1; part <= 4 && !moving; ++part) {
      moving = moves(here, scene_.at(t + (next - t) * part / 4));
    }
    t = moving ? std::min(next, t + kMovingStepNs) : next;
    nodes_ns.push_back(t);
  }
}

/// Computes the views of a point at the nodes and between them.
std::vector<ViewSample> PointHistories::views(const SolvePoint& point,
                                              std::span<const std::int64_t> nodes_ns,
                                              std::span<const SceneInstant> instants,
                                              std::int64_t sim_time_ns) const {
  return PointViews(scene_, climate_, point, rays_, sim_time_ns).run(nodes_ns, instants);
}

Result<std::vector<double>> PointHistories::temperatures(
    std::span<const SolvePoint> points, std::int64_t sim_time_ns,
    const std::function<bool(double)>& done) const {
  std::vector<std::int64_t> nodes_ns;
  choose_nodes(sim_time_ns, nodes_ns);
  std::vector<SceneInstant> instants;
  instants.reserve(nodes_ns.size());
  for (const std::int64_t t : nodes_ns) instants.push_back(scene_.at(t));

  // Build one mesh per material.
  std::map<std::uint32_t, LayerMesh> meshes;
  for (const SolvePoint& point : points) {
    const scene::Material& material = geometry_.materials[point.material];
    if (material.prescribed_k || meshes.contains(point.material)) continue;
    auto mesh = material_mesh(material);
    if (!mesh) return tl::unexpected(std::move(mesh.error()));
    meshes.emplace(point.material, std::move(*mesh));
  }

  // Solve the points in portions, in parallel, and report the progress after each.
  std::vector<double> kelvin(points.size(), std::numeric_limits<double>::quiet_NaN());
  tbb::enumerable_thread_specific<std::map<std::uint32_t, PointSolver>> solvers;
  const std::size_t portion = std::max<std::size_t>(64, points.size() / 100);
  for (std::size_t begin = 0; begin < points.size(); begin += portion) {
    const std::size_t end = std::min(points.size(), begin + portion);
    threads::parallel_ranges(
        tbb::blocked_range<std::size_t>(begin, end, 4), [&](const auto& range) {
          for (std::size_t i = range.begin(); i != range.end(); ++i) {
            const SolvePoint& point = points[i];
            const scene::Material& material = geometry_.materials[point.material];
            if (material.prescribed_k) {
              kelvin[i] = *material.prescribed_k;
              continue;
            }
            // Keep one solver per thread and material.
            auto& mine = solvers.local();
            const auto solver =
                mine.try_emplace(point.material, climate_, meshes.at(point.material), material,
                                 scenario_.thermal.initial_k)
                    .first;
            const std::vector<ViewSample> front = views(point, nodes_ns, instants, sim_time_ns);
            std::vector<ViewSample> back;
            if (material.sheet) {
              SolvePoint behind = point;
              behind.normal = -point.normal;
              back = views(behind, nodes_ns, instants, sim_time_ns);
            }
            solver->second.run(point.normal, {front, back}, std::span(&sim_time_ns, 1),
                               std::span(&kelvin[i], 1));
          }
        });
    if (done && !done(static_cast<double>(end) / static_cast<double>(points.size()))) break;
  }
  return kelvin;
}

}  // namespace emit::reference
