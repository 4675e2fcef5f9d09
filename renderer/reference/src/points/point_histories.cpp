// SPDX-License-Identifier: Apache-2.0
#include "points/point_histories.hpp"

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
#include "points/body_interiors.hpp"
#include "points/entity_courses.hpp"
#include "points/point_views.hpp"
#include "points/prescribed_parts.hpp"
#include "points/sight.hpp"

namespace emit::reference {
namespace {

using physics::Result;

/// Rays for the scenery in the view: one for so many of those for the sky, and at least so many.
constexpr std::uint32_t kRaysPerSightRay = 4;
constexpr std::uint32_t kLeastSightRays = 16;
/// Size of the patches that patches and the faces of bodies see, over that of those that a point of
/// the picture sees: of the former the mean radiation alone counts.
constexpr double kCoarserPatches = 4.0;
/// Points that stand for the faces of a body: of one that a point of the picture lies on, and of
/// one that is only seen from there.
constexpr std::size_t kPointsPerBody = 128;
constexpr std::size_t kPointsPerSeenBody = 32;
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

/// Solution of one instant: nodes, meshes and solvers that its points share.
class PointHistories::Run {
 public:
  Run(const PointHistories& all, std::int64_t sim_time_ns)
      : all_(all), parts_(all.geometry_, all.scene_) {
    nodes_ns_ = view_nodes(all.scene_, all.climate_, all.dense_from_ns_, sim_time_ns);
    instants_.reserve(nodes_ns_.size());
    for (const std::int64_t t : nodes_ns_) instants_.push_back(all.scene_.at(t));
    bodies_.emplace(all.scenario_, all.geometry_, all.scene_, all.climate_, nodes_ns_,
                    instants_.back());
    courses_.emplace(all.scenario_, all.geometry_, scene_nodes());
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

  /// Returns the scene at the instant of the solution.
  [[nodiscard]] const SceneInstant& now() const noexcept { return instants_.back(); }

  /// Returns the rays of what a point sees, epoch by epoch. While its own entity moves they are of
  /// the entity alone, and while others pass they leave these out.
  [[nodiscard]] std::vector<SightBuilder::EpochRays> rays_of(const SolvePoint& point) const {
    const SceneNodes nodes = scene_nodes();
    const CarriedPoint carried(point, now());
    std::vector<SightBuilder::EpochRays> out;
    for (const ViewEpoch& epoch : view_epochs(point, nodes)) {
      // The picture lies at the end of the last epoch; the others are looked at in their middle.
      const bool last = epoch.last + 1 == instants_.size();
      const std::size_t node = last ? epoch.last : (epoch.first + epoch.last) / 2;
      SightBuilder::EpochRays& rays = out.emplace_back();
      rays.from_ns = nodes_ns_[epoch.first];
      rays.instant = &instants_[node];
      // An entity that is switched off stands in the open.
      const bool on = point.entity == kNoEntity || instants_[node].entity_on(point.entity);
      rays.other_entities = on && !epoch.brief;
      rays.scenery = on && (!epoch.brief || !epoch.own_moves);
      rays.rays.resize(std::max(kLeastSightRays, all_.rays_ / kRaysPerSightRay));
      SurfacePoint place = carried.at(instants_[node]);
      place.tolerance_m = 1e-9;
      instants_[node].hemisphere(place, rays.rays);
      // Parts of prescribed temperatures are summed by their area.
      if (parts_.empty()) continue;
      rays.parts = parts_.seen_from(place, point.entity, rays.other_entities, instants_[node]);
      for (HemisphereRay& ray : rays.rays) {
        const bool entity = ray.hit_surface && ray.hit.entity != kNoEntity;
        if (entity && all_.geometry_.materials[ray.hit.material].prescribed_k) {
          ray.hit_surface = false;
        }
      }
    }
    return out;
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
    const std::vector<MotionSample> motion = courses_->motion(point);
    solver->second.run(point.normal,
                       {front, back, rain_frac(point.normal), rain_frac(-point.normal), base,
                        motion, courses_->film_body(point)},
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
  [[nodiscard]] SceneNodes scene_nodes() const { return {all_.scene_, nodes_ns_, instants_}; }
  /// Computes the views of a point at the nodes and between them.
  [[nodiscard]] std::vector<ViewSample> views(const SolvePoint& point) const {
    return point_views(all_.climate_, point, all_.rays_, scene_nodes());
  }

  const PointHistories& all_;
  PrescribedParts parts_;
  std::vector<std::int64_t> nodes_ns_;
  std::vector<SceneInstant> instants_;
  std::optional<BodyInteriors> bodies_;
  std::optional<EntityCourses> courses_;
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
                                  double patch_factor, SightBuilder& sight,
                                  std::span<PointSight> front, std::span<PointSight> back) const {
  constexpr std::size_t kPortion = 512;
  std::vector<std::vector<SightBuilder::EpochRays>> rays(kPortion);
  std::vector<std::vector<SightBuilder::EpochRays>> back_rays(kPortion);
  for (std::size_t begin = 0; begin < points.size(); begin += kPortion) {
    const std::size_t end = std::min(points.size(), begin + kPortion);
    threads::parallel_indices(begin, end, [&](std::size_t i) {
      const bool sheet = geometry_.materials[points[i].material].sheet;
      rays[i - begin] = run.rays_of(points[i]);
      back_rays[i - begin].clear();
      if (sheet) back_rays[i - begin] = run.rays_of(back_of(points[i]));
    });
    for (std::size_t i = begin; i < end; ++i) {
      front[i] = sight.add(points[i], rays[i - begin], patch_factor);
      back[i] = sight.add(points[i], back_rays[i - begin], patch_factor);
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
  SightBuilder sight(run.now());
  const bool exchange = scenario_.thermal.exchange;
  if (exchange) trace_sights(run, points, 1.0, sight, solution.sights, back_sights);
  // The bodies of the points see patches too. Those of patches do not.
  run.bodies().add(points, kPointsPerBody);
  const std::size_t own_bodies = run.bodies().size();
  std::vector<PointSight> body_sights(run.bodies().points().size());
  if (exchange) {
    std::vector<PointSight> no_backs(body_sights.size());
    trace_sights(run, run.bodies().points(), kCoarserPatches, sight, body_sights, no_backs);
  }
  // The patches see further patches, which take their surroundings for all that they see.
  const std::size_t seen = sight.patches().size();
  const std::vector<SolvePoint> near_places = sight.patches();
  std::vector<PointSight> patch_sights(seen);
  std::vector<PointSight> patch_back_sights(seen);
  if (exchange)
    trace_sights(run, near_places, kCoarserPatches, sight, patch_sights, patch_back_sights);
  const std::vector<SolvePoint>& places = sight.patches();
  if (auto built = run.add_meshes(places); !built) return tl::unexpected(std::move(built.error()));
  run.bodies().add(places, kPointsPerSeenBody);
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
      std::ranges::any_of(body_sights, [](const PointSight& sees) { return !sees.epochs.empty(); });
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
