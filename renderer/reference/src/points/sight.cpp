// SPDX-License-Identifier: Apache-2.0
#include "points/sight.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "emit/physics/constants.hpp"

namespace emit::reference {
namespace {

/// Size of a patch over its distance, and its least size. Sizes are powers of two.
constexpr double kPatchPerDistance = 0.1;
constexpr double kSmallestPatchM = 0.05;
/// Steps per unit of each component of a patch's normal.
constexpr double kNormalSteps = 2.0;

}  // namespace

std::uint32_t SightBuilder::patch_of(const RayHit& hit, const SceneInstant& instant,
                                     double patch_factor) {
  glm::dvec3 normal = hit.front ? hit.geometric_normal : -hit.geometric_normal;
  glm::dvec3 place_m = hit.position_world_m;
  // Cut entities into patches in their own frame.
  const bool carried = hit.entity != kNoEntity;
  if (carried) {
    const physics::Pose& then = instant.entity_pose(hit.entity);
    const glm::dquat body_from_world = glm::conjugate(then.world_from_body);
    place_m = body_from_world * (place_m - then.position_world_m);
    normal = body_from_world * normal;
  }
  const double wanted_m =
      patch_factor * std::max(kSmallestPatchM, kPatchPerDistance * hit.distance_m);
  const double level = std::floor(std::log2(wanted_m / kSmallestPatchM));
  const double size_m = kSmallestPatchM * std::exp2(level);
  Key key{};
  key[0] = static_cast<std::int64_t>(level);
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    key[1 + a] = std::llround(std::floor(place_m[axis] / size_m));
    key[4 + a] = std::llround(kNormalSteps * normal[axis]);
  }
  key[7] = hit.material;
  key[8] = carried ? static_cast<std::int64_t>(hit.entity) : -1;
  const auto [found, added] = index_.try_emplace(key, static_cast<std::uint32_t>(patches_.size()));
  if (!added) return found->second;
  if (carried) {
    const physics::Pose& now = now_->entity_pose(hit.entity);
    place_m = now.position_world_m + now.world_from_body * place_m;
    normal = now.world_from_body * normal;
  }
  patches_.push_back({place_m, normal, hit.material, hit.entity, hit.instance});
  return found->second;
}

PointSight SightBuilder::add(const SolvePoint& point, std::span<const EpochRays> epochs,
                             double patch_factor) {
  PointSight sight;
  for (const EpochRays& epoch : epochs) {
    SightEpoch& out = sight.epochs.emplace_back();
    out.from_ns = epoch.from_ns;
    out.parts = epoch.parts;
    std::map<std::uint32_t, std::uint32_t> hits;
    for (const HemisphereRay& ray : epoch.rays) {
      if (!ray.hit_surface) continue;
      // The point sees the same of its own entity in every epoch.
      const bool own = point.entity != kNoEntity && ray.hit.entity == point.entity;
      const bool counts =
          own || (ray.hit.entity == kNoEntity ? epoch.scenery : epoch.other_entities);
      if (counts) ++hits[patch_of(ray.hit, *epoch.instant, patch_factor)];
    }
    for (const auto& [patch, count] : hits) {
      out.links.push_back(
          {patch, static_cast<double>(count) / static_cast<double>(epoch.rays.size())});
    }
  }
  return sight;
}

PatchHistories::PatchHistories(std::span<const std::int64_t> nodes_ns, std::size_t patches)
    : nodes_ns_(nodes_ns), radiation_(nodes_ns.size() * patches), last_(patches) {}

std::span<PatchRadiation> PatchHistories::of(std::size_t patch) noexcept {
  return std::span(radiation_).subspan(patch * nodes_ns_.size(), nodes_ns_.size());
}

void PatchHistories::add_to(std::span<ViewSample> views, const PointSight& sight) const {
  if (sight.epochs.empty()) return;
  std::size_t epoch = 0;
  for (ViewSample& view : views) {
    // Find the epoch of the view.
    while (epoch + 1 < sight.epochs.size() && sight.epochs[epoch + 1].from_ns <= view.time_ns) {
      ++epoch;
    }
    const std::vector<SightLink>& links = sight.epochs[epoch].links;
    const std::vector<PartLink>& parts = sight.epochs[epoch].parts;
    double share = 0.0;
    for (const SightLink& link : links) share += link.share_frac;
    for (const PartLink& part : parts) share += part.share_frac;
    if (!(share > 0.0)) continue;
    // Find the instants around the view's, between which patches are linear.
    const auto after = std::upper_bound(nodes_ns_.begin(), nodes_ns_.end(), view.time_ns);
    const auto b = std::clamp<std::ptrdiff_t>(after - nodes_ns_.begin(), 0,
                                              static_cast<std::ptrdiff_t>(nodes_ns_.size()) - 1);
    const auto high = static_cast<std::size_t>(b);
    const std::size_t low = high > 0 ? high - 1 : 0;
    const auto span_ns = static_cast<double>(nodes_ns_[high] - nodes_ns_[low]);
    const double part =
        span_ns > 0.0
            ? std::clamp(static_cast<double>(view.time_ns - nodes_ns_[low]) / span_ns, 0.0, 1.0)
            : 0.0;
    double shortwave = 0.0;
    double longwave = 0.0;
    for (const SightLink& link : links) {
      const PatchRadiation* const all = radiation_.data() + link.patch * nodes_ns_.size();
      const PatchRadiation& x = all[low];
      const PatchRadiation& y = all[high];
      shortwave +=
          link.share_frac * (x.shortwave_w_m2 + part * (y.shortwave_w_m2 - x.shortwave_w_m2));
      longwave += link.share_frac * (x.longwave_w_m2 + part * (y.longwave_w_m2 - x.longwave_w_m2));
    }
    for (const PartLink& link : parts) longwave += link.share_frac * link.emitted_w_m2;
    const double room = std::clamp(1.0 - view.sky_frac, 0.0, share) / share;
    view.scene_frac = share * room;
    view.scene_shortwave_w_m2 += shortwave * room;
    view.scene_longwave_w_m2 += longwave * room;
  }
}

PatchRadiation patch_radiation(const ClimateNode& now, const SurfaceOptics& optics,
                               const ViewSample& view, double surroundings_reflectance_frac,
                               double kelvin) {
  // Take what the patch absorbs for what falls on it: without long waves for the sunlight, without
  // sunlight for the long waves.
  const double e = optics.emissivity_frac;
  SurfaceOptics black = optics;
  black.solar_absorptance_frac = 1.0;
  black.emissivity_frac = 0.0;
  const double shortwave =
      face_state(now, black, view, surroundings_reflectance_frac).absorbed_w_m2;
  black.solar_absorptance_frac = 0.0;
  black.emissivity_frac = 1.0;
  const double longwave = face_state(now, black, view, surroundings_reflectance_frac).absorbed_w_m2;
  const double t2 = kelvin * kelvin;
  return {
      static_cast<float>((1.0 - optics.solar_absorptance_frac) * shortwave),
      static_cast<float>(e * physics::kStefanBoltzmannWPerM2K4 * t2 * t2 + (1.0 - e) * longwave)};
}

}  // namespace emit::reference
