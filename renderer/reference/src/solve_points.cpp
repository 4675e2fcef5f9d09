// SPDX-License-Identifier: Apache-2.0
#include "solve_points.hpp"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "emit/reference/surface_water.hpp"
#include "emit/threads/parallel.hpp"
#include "solve_bodies.hpp"
#include "solve_sight.hpp"

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
/// Rays for the scenery in the view: one for so many of those for the sky, and at least so many.
constexpr std::uint32_t kRaysPerSightRay = 4;
constexpr std::uint32_t kLeastSightRays = 16;
/// Distance beyond which an entity does not change a point's view of the sky.
constexpr double kEntityReachM = 25.0;

/// Runs `body` for every index below `count` in portions, in parallel, and reports after each with
/// the share done, which goes from `from` to `to`. Returns false if `done` stopped it.
template <class Body>
bool in_portions(std::size_t count, double from, double to, const std::function<bool(double)>& done,
                 Body body) {
  const std::size_t portion = std::max<std::size_t>(64, count / 100);
  for (std::size_t begin = 0; begin < count; begin += portion) {
    const std::size_t end = std::min(count, begin + portion);
    threads::parallel_ranges(tbb::blocked_range<std::size_t>(begin, end, 4),
                             [&](const auto& range) {
                               for (std::size_t i = range.begin(); i != range.end(); ++i) body(i);
                             });
    const double share = static_cast<double>(end) / static_cast<double>(count);
    if (done && !done(from + (to - from) * share)) return false;
  }
  return true;
}

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
        const bool moves =
            step < kStaticStepNs && (climate_.clouds() == nullptr || step <= kMovingStepNs);
        refine(nodes_ns[i - 1], last_sun, nodes_ns[i], sun,
               moves                  ? kShortestMovingNs
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
  // Clouds pass within that time. Steps of one kind are told from those of others by their length.
  std::int64_t static_ns = kStaticStepNs;
  if (climate_.clouds() != nullptr) {
    static_ns = std::clamp<std::int64_t>(std::llround(1e9 * climate_.clouds()->step_s()),
                                         kMovingStepNs + 1, kStaticStepNs);
  }
  while (t < until_ns) {
    const std::int64_t next = std::min(until_ns, t + static_ns);
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

/// Solution of one instant: nodes, meshes and solvers that its points share.
class PointHistories::Run {
 public:
  Run(const PointHistories& all, std::int64_t sim_time_ns) : all_(all), sim_time_ns_(sim_time_ns) {
    all.choose_nodes(sim_time_ns, nodes_ns_);
    instants_.reserve(nodes_ns_.size());
    for (const std::int64_t t : nodes_ns_) instants_.push_back(all.scene_.at(t));
    bodies_.emplace(all.scenario_, all.geometry_, all.scene_, all.climate_, nodes_ns_,
                    instants_.back());
  }
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;
  ~Run() = default;

  [[nodiscard]] std::span<const std::int64_t> nodes_ns() const noexcept { return nodes_ns_; }

  /// Builds one mesh per material. Errors: those of material_mesh().
  Result<void> add_meshes(std::span<const SolvePoint> points) {
    for (const SolvePoint& point : points) {
      const scene::Material& material = all_.geometry_.materials[point.material];
      if (material.prescribed_k || meshes_.contains(point.material)) continue;
      auto mesh = material_mesh(material);
      if (!mesh) return tl::unexpected(std::move(mesh.error()));
      meshes_.emplace(point.material, std::move(*mesh));
    }
    return {};
  }

  [[nodiscard]] BodyInteriors& bodies() noexcept { return *bodies_; }

  /// Returns the rays of the scenery in the view of a point at the instant of the solution.
  [[nodiscard]] std::vector<HemisphereRay> rays_of(const SolvePoint& point) const {
    std::vector<HemisphereRay> rays(std::max(kLeastSightRays, all_.rays_ / kRaysPerSightRay));
    instants_.back().hemisphere({point.position_world_m, point.normal, 1e-9}, rays);
    return rays;
  }

  /// Computes the temperatures of a point at times that ascend. `sees` and `back_sees` are what the
  /// point and its back see of `patches`. Returns the views of the front.
  std::vector<ViewSample> solve(const SolvePoint& point, const PatchHistories* patches,
                                const PointSight& sees, const PointSight& back_sees,
                                std::span<const std::int64_t> times_ns, std::span<double> out_k) {
    const scene::Material& material = all_.geometry_.materials[point.material];
    std::vector<ViewSample> front = views(point);
    if (patches != nullptr) patches->add_to(front, sees);
    if (material.prescribed_k) {
      std::ranges::fill(out_k, *material.prescribed_k);
      return front;
    }
    const std::span<const BaseSample> base = bodies_->course(point);
    std::vector<ViewSample> back;
    if (material.sheet) {
      SolvePoint behind = point;
      behind.normal = -point.normal;
      back = views(behind);
      if (patches != nullptr) patches->add_to(back, back_sees);
    }
    carry(point, front, back, base, times_ns, out_k, {});
    return front;
  }

  /// Computes the temperatures of a point from its views and the course of its base, and the heat
  /// that leaves through the base if `out_base_j_m2` is not empty.
  void carry(const SolvePoint& point, std::span<const ViewSample> front,
             std::span<const ViewSample> back, std::span<const BaseSample> base,
             std::span<const std::int64_t> times_ns, std::span<double> out_k,
             std::span<double> out_base_j_m2) {
    const scene::Material& material = all_.geometry_.materials[point.material];
    // Keep one solver per thread and material.
    auto& mine = solvers_.local();
    const auto solver = mine.try_emplace(point.material, all_.climate_, meshes_.at(point.material),
                                         material, all_.scenario_.thermal.initial_k)
                            .first;
    // Rain counts with what stands above the point at the instant of the solution.
    const bool dry = scene::water_store_of(material).none();
    const auto rain_frac = [&](const glm::dvec3& normal) -> std::optional<double> {
      if (dry) return std::nullopt;
      return rain_on_face_frac(instants_.back(), {point.position_world_m, normal, 1e-9});
    };
    solver->second.run(point.normal,
                       {front, back, rain_frac(point.normal), rain_frac(-point.normal), base},
                       times_ns, out_k, out_base_j_m2);
  }

  /// Brings the interiors of the first `bodies` bodies into balance. `patches` and `sights` are
  /// what their points see of the scenery; no patches leave it out.
  bool balance(std::size_t bodies, const PatchHistories* patches,
               std::span<const PointSight> sights, const std::function<bool(double)>& done) {
    const std::span<const SolvePoint> points = bodies_->points();
    // The views are the same in all rounds.
    const std::size_t had = body_views_.size();
    body_views_.resize(points.size());
    if (!in_portions(points.size() - had, 0.0, 0.5, done,
                     [&](std::size_t p) { body_views_[had + p] = views(points[had + p]); })) {
      return false;
    }
    std::vector<std::vector<ViewSample>> lit(body_views_);
    for (std::size_t p = 0; patches != nullptr && p < sights.size(); ++p) {
      patches->add_to(lit[p], sights[p]);
    }
    return bodies_->balance(
        bodies,
        [&](std::size_t p, std::span<const BaseSample> base, std::span<double> out_base_j_m2) {
          std::vector<double> kelvin(nodes_ns_.size());
          carry(points[p], lit[p], {}, base, nodes_ns_, kelvin, out_base_j_m2);
        },
        [&](double share) { return !done || done(0.5 + 0.5 * share); });
  }

  /// Computes the radiation of a patch at all nodes, and its last state.
  void solve_patch(const SolvePoint& place, const PatchHistories* patches, const PointSight& sees,
                   const PointSight& back_sees, std::span<PatchRadiation> out, PatchState& last) {
    std::vector<double> kelvin(nodes_ns_.size());
    const std::vector<ViewSample> seen = solve(place, patches, sees, back_sees, nodes_ns_, kelvin);
    const scene::Material& material = all_.geometry_.materials[place.material];
    const SurfaceOptics optics{place.normal, material.solar_absorptance_frac,
                               material.emissivity_frac};
    auto view = seen.begin();
    for (std::size_t node = 0; node < nodes_ns_.size(); ++node) {
      while (view->time_ns < nodes_ns_[node] && view + 1 != seen.end()) ++view;
      out[node] = patch_radiation(all_.climate_.at(nodes_ns_[node]), optics, *view,
                                  all_.climate_.surroundings_reflectance_frac(), kelvin[node]);
    }
    last = {kelvin.back(), seen.back().sky_frac};
  }

 private:
  /// Computes the views of a point at the nodes and between them.
  [[nodiscard]] std::vector<ViewSample> views(const SolvePoint& point) const {
    return PointViews(all_.scene_, all_.climate_, point, all_.rays_, sim_time_ns_)
        .run(nodes_ns_, instants_);
  }

  const PointHistories& all_;
  std::int64_t sim_time_ns_;
  std::vector<std::int64_t> nodes_ns_;
  std::vector<SceneInstant> instants_;
  std::optional<BodyInteriors> bodies_;
  std::vector<std::vector<ViewSample>> body_views_;  ///< of the points of the bodies
  std::map<std::uint32_t, LayerMesh> meshes_;
  tbb::enumerable_thread_specific<std::map<std::uint32_t, PointSolver>> solvers_;
};

namespace {

/// Returns a point as its back sees it.
SolvePoint back_of(SolvePoint point) {
  point.normal = -point.normal;
  return point;
}

}  // namespace

/// Finds what points and the backs of sheets see. Traces portions in parallel and numbers the
/// patches in the order of the points.
void PointHistories::trace_sights(const Run& run, std::span<const SolvePoint> points,
                                  SightBuilder& sight, std::span<PointSight> front,
                                  std::span<PointSight> back) const {
  constexpr std::size_t kPortion = 512;
  std::vector<std::vector<HemisphereRay>> rays(kPortion);
  std::vector<std::vector<HemisphereRay>> back_rays(kPortion);
  for (std::size_t begin = 0; begin < points.size(); begin += kPortion) {
    const std::size_t end = std::min(points.size(), begin + kPortion);
    threads::parallel_indices(begin, end, [&](std::size_t i) {
      const bool sheet = geometry_.materials[points[i].material].sheet;
      rays[i - begin] = run.rays_of(points[i]);
      back_rays[i - begin] = sheet ? run.rays_of(back_of(points[i])) : std::vector<HemisphereRay>();
    });
    for (std::size_t i = begin; i < end; ++i) {
      front[i] = sight.add(points[i], rays[i - begin]);
      back[i] = sight.add(points[i], back_rays[i - begin]);
    }
  }
}

Result<PointSolution> PointHistories::temperatures(std::span<const SolvePoint> points,
                                                   std::int64_t sim_time_ns,
                                                   const std::function<bool(double)>& done) const {
  Run run(*this, sim_time_ns);
  if (auto built = run.add_meshes(points); !built) return tl::unexpected(std::move(built.error()));
  PointSolution solution;
  solution.kelvin.assign(points.size(), std::numeric_limits<double>::quiet_NaN());
  solution.sights.resize(points.size());
  std::vector<PointSight> back_sights(points.size());
  SightBuilder sight;
  const bool exchange = scenario_.thermal.exchange;
  if (exchange) trace_sights(run, points, sight, solution.sights, back_sights);
  // The bodies of the points see patches too. Those of patches do not.
  run.bodies().add(points);
  const std::size_t own_bodies = run.bodies().size();
  std::vector<PointSight> body_sights(run.bodies().points().size());
  if (exchange) {
    std::vector<PointSight> no_backs(body_sights.size());
    trace_sights(run, run.bodies().points(), sight, body_sights, no_backs);
  }
  // The patches see further patches, which take their surroundings for all that they see.
  const std::size_t seen = sight.patches().size();
  const std::vector<SolvePoint> near_places = sight.patches();
  std::vector<PointSight> patch_sights(seen);
  std::vector<PointSight> patch_back_sights(seen);
  if (exchange) trace_sights(run, near_places, sight, patch_sights, patch_back_sights);
  const std::vector<SolvePoint>& places = sight.patches();
  if (auto built = run.add_meshes(places); !built) return tl::unexpected(std::move(built.error()));
  run.bodies().add(places);
  solution.bodies = run.bodies().size();
  const std::span<const SolvePoint> body_points = run.bodies().points();
  if (auto built = run.add_meshes(body_points); !built) {
    return tl::unexpected(std::move(built.error()));
  }
  PatchHistories far_patches(run.nodes_ns(), places.size());
  PatchHistories patches(run.nodes_ns(), seen);
  // Solve the interiors and the patches without others, the patches that the points see with them,
  // the interiors of the points with those, then the points.
  const double each =
      1.0 /
      std::max(1.0, static_cast<double>(body_points.size() + places.size() + seen + points.size()));
  const double bodies = 0.8 * each * static_cast<double>(body_points.size());
  const double first = bodies + each * static_cast<double>(places.size());
  const double second = first + each * static_cast<double>(seen);
  const double third = second + 0.25 * bodies;
  const auto part_of = [&](double from, double to) {
    return [&done, from, to](double share) { return !done || done(from + (to - from) * share); };
  };
  const bool lit_bodies =
      std::ranges::any_of(body_sights, [](const PointSight& sees) { return !sees.links.empty(); });
  const bool all_patches =
      run.balance(run.bodies().size(), nullptr, {}, part_of(0.0, bodies)) &&
      in_portions(places.size(), bodies, first, done,
                  [&](std::size_t i) {
                    run.solve_patch(places[i], nullptr, {}, {}, far_patches.of(i),
                                    far_patches.last(i));
                  }) &&
      in_portions(seen, first, second, done,
                  [&](std::size_t i) {
                    run.solve_patch(places[i], &far_patches, patch_sights[i], patch_back_sights[i],
                                    patches.of(i), patches.last(i));
                  }) &&
      (!lit_bodies || run.balance(own_bodies, &patches, body_sights, part_of(second, third)));
  solution.interior_left_k = run.bodies().left_k();
  if (!all_patches) {
    solution.sights.assign(points.size(), {});
    return solution;
  }
  in_portions(points.size(), third, 1.0, done, [&](std::size_t i) {
    run.solve(points[i], &patches, solution.sights[i], back_sights[i], std::span(&sim_time_ns, 1),
              std::span(&solution.kelvin[i], 1));
  });
  for (std::size_t i = 0; i < seen; ++i) {
    solution.patch_material.push_back(places[i].material);
    solution.patches.push_back(patches.last(i));
  }
  return solution;
}

}  // namespace emit::reference
