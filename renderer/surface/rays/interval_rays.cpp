// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/interval_rays.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "history/step_plan.hpp"
#include "surface/mesh/tangents.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer {
namespace {

/// Every so many instants of rays, stratified over the interval, one counts for the mean stand.
constexpr std::size_t kStandStrata = 8;
constexpr float kStandShare = static_cast<float>(kStandStrata) / kSunRays;
static_assert(kSunRays % kStandStrata == 0);
constexpr double kGolden = 0.6180339887498949;
/// Distance, in radii of an entity, from which on it hides too little sky to matter (1/400).
constexpr float kNearRadii = 10.0F;
/// Largest share of the sky that an entity may hide without touching a place (touches()).
constexpr float kMaxHiddenFrac = 1.0F / 16.0F;
constexpr std::size_t kSkyRays = 16;
static_assert(kSkyRays == kPacketRays);
/// Room for the rounding of float32, as a share of the distance.
constexpr float kRoundingFrac = 1e-5F;
/// Largest distance of the start of a ray from its place, in standard deviations of the blur.
constexpr float kMaxDeviates = 3.5F;

double fraction_of(double x) noexcept {
  return x - std::floor(x);
}

/// Returns the inverse of the normal distribution, for u between 0 and 1.
double normal_deviate(double u) noexcept {
  // Bisect on erf: exact to double, and its cost is paid once, at the first use.
  double low = -6.0;
  double high = 6.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (0.5 * (1.0 + std::erf(middle / std::sqrt(2.0))) < u ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// Returns the place of a ray in the disc. Rays go from the rim inwards: if the first packet agrees
/// at the rim, nearly all of the disc agrees.
constexpr std::size_t place_in_disc(std::size_t ray) noexcept {
  return kSunRays - 1 - ray;
}

/// Directions of the sky rays in the axes (tangent, bitangent, normal) of a face.
using SkyDirections = std::array<glm::vec3, kSkyRays>;

/// Spreads directions over the hemisphere on a spiral, evenly by the measure.
SkyDirections make_sky_directions(SkyMeasure measure) noexcept {
  SkyDirections out;
  for (std::size_t i = 0; i < kSkyRays; ++i) {
    const double share = (static_cast<double>(i) + 0.5) / kSkyRays;
    const double r = std::sqrt(measure == SkyMeasure::cosine ? share : share * (2.0 - share));
    const double angle = 2.0 * physics::kPi * fraction_of(kGolden * (static_cast<double>(i) + 0.5));
    out[i] = {static_cast<float>(r * std::cos(angle)), static_cast<float>(r * std::sin(angle)),
              static_cast<float>(std::sqrt(1.0 - r * r))};
  }
  return out;
}

const SkyDirections& sky_directions(SkyMeasure measure) noexcept {
  static const SkyDirections cosine = make_sky_directions(SkyMeasure::cosine);
  static const SkyDirections sphere = make_sky_directions(SkyMeasure::sphere);
  return measure == SkyMeasure::cosine ? cosine : sphere;
}

std::array<double, kSunRays> normal_deviates() noexcept {
  std::array<double, kSunRays> out{};
  for (std::size_t i = 0; i < kSunRays; ++i)
    out[i] = normal_deviate((static_cast<double>(i) + 0.5) / kSunRays);
  return out;
}

}  // namespace

void IntervalRays::aim(std::size_t ray, std::uint32_t turn, const glm::dvec3& to_sun) noexcept {
  static const std::array<double, kSunRays> deviates = normal_deviates();
  const std::size_t place = place_in_disc(ray);
  const double radius = std::tan(physics::kSunSemiAngleRad) *
                        std::sqrt((static_cast<double>(place) + 0.5) / kSunRays);
  // Turn the spiral of the disc by another angle in every interval.
  const double angle =
      2.0 * physics::kPi * fraction_of(kGolden * (static_cast<double>(place) + 0.5) + 0.37 * turn);
  const glm::dvec3 u = glm::normalize(glm::cross(
      std::abs(to_sun.z) < 0.9 ? glm::dvec3(0.0, 0.0, 1.0) : glm::dvec3(1.0, 0.0, 0.0), to_sun));
  const glm::dvec3 v = glm::cross(to_sun, u);
  direction_[ray] =
      glm::vec3(glm::normalize(to_sun + radius * (std::cos(angle) * u + std::sin(angle) * v)));
  // Permute the strata of both shifts by odd multipliers, so that they do not correlate with the
  // place.
  spread_[ray] = glm::vec2(static_cast<float>(deviates[(place * 23 + turn * 3) % kSunRays]),
                           static_cast<float>(deviates[(place * 45 + 5 + turn * 9) % kSunRays]));
}

void IntervalRays::anchor(std::vector<EntityAnchor> anchors) {
  EMIT_CHECK(anchors.empty() || anchors.size() == entity_radius_m_.size());
  anchors_ = std::move(anchors);
}

void IntervalRays::update(std::int64_t begin_ns, std::int64_t end_ns, std::uint32_t turn,
                          const Environment& environment, const EntityPoses& poses,
                          const glm::dvec3& origin_world_m) noexcept {
  const std::size_t entities = entity_radius_m_.size();
  clouds_.update(begin_ns, end_ns, environment, origin_world_m);
  any_entity_on_ = false;
  sun_up_ = false;
  std::ranges::fill(stands_, EntityStand{glm::vec3(0.0F), 0.0F});
  for (std::size_t i = 0; i < kSunRays; ++i) {
    // Permute the strata of time by an odd multiplier.
    const std::size_t stratum = (place_in_disc(i) * 27 + turn * 5) % kSunRays;
    if (stratum == kSunRays / 2) middle_ray_ = i;
    const bool stands = !anchors_.empty() && stratum % kStandStrata == kStandStrata / 2;
    const double t = (static_cast<double>(stratum) + 0.5) / kSunRays;
    const auto at_ns = begin_ns + std::llround(t * static_cast<double>(end_ns - begin_ns));
    const physics::SunPosition sun = environment.sun_at(at_ns);
    sun_up_ = sun_up_ || sun.elevation.value() > StepPlan::kMinSunElevationRad;
    aim(i, turn, sun.direction_enu);
    // Place every entity at the instant of the ray.
    for (std::size_t m = 0; m < entities; ++m) {
      EntityPlacement& place = placements_[m * kSunRays + i];
      const TrajectoryState state = poses.at(m, at_ns);
      place = placement_of(state, origin_world_m);
      if (stands) stands_[m].add(stand_of(state.pose, anchors_[m]), kStandShare);
      any_entity_on_ = any_entity_on_ || place.on;
    }
  }
  bound_packets();
}

void IntervalRays::bound_packets() noexcept {
  const std::size_t entities = entity_radius_m_.size();
  for (std::size_t packet = 0; packet < spread_sine_.size(); ++packet) {
    const std::size_t first = packet * kPacketRays;
    spread_sine_[packet] = 0.0F;
    for (std::size_t i = first; i < first + kPacketRays; ++i) {
      spread_sine_[packet] =
          std::max(spread_sine_[packet], glm::distance(direction_[i], direction_[first]));
    }
    for (std::size_t m = 0; m < entities; ++m) {
      Reach& ball = reaches_[packet * entities + m];
      ball = {};
      // Enclose the origins of the body in a box, its corners in a sphere, and add the radius of
      // the geometry.
      glm::vec3 low(std::numeric_limits<float>::infinity());
      glm::vec3 high = -low;
      for (std::size_t i = first; i < first + kPacketRays; ++i) {
        const EntityPlacement& place = placed(m, i);
        ball.changes = ball.changes || place.on != placed(m, 0).on ||
                       place.position_m != placed(m, 0).position_m ||
                       place.rel_from_body != placed(m, 0).rel_from_body;
        if (!place.on) continue;
        low = glm::min(low, placed(m, i).position_m);
        high = glm::max(high, placed(m, i).position_m);
      }
      if (!(low.x <= high.x)) continue;
      ball.centre_m = 0.5F * (low + high);
      ball.way_m = 0.5F * glm::distance(low, high);
      ball.radius_m = ball.way_m + entity_radius_m_[m];
    }
  }
  for (std::size_t m = 0; m < entities; ++m) middle_[m] = placed(m, middle_ray_);
}

bool IntervalRays::stands(std::size_t entity) const noexcept {
  for (std::size_t packet = 0; packet < kSunRays / kPacketRays; ++packet) {
    const Reach& ball = reach(entity, packet);
    if (ball.changes || ball.radius_m < 0.0F) return false;
  }
  return true;
}

void IntervalRays::hold(const glm::dvec3& to_sun) noexcept {
  for (EntityPlacement& place : placements_) place.on = false;
  clouds_.clear();
  any_entity_on_ = false;
  sun_up_ = to_sun.z > std::sin(StepPlan::kMinSunElevationRad);
  for (std::size_t i = 0; i < kSunRays; ++i) aim(i, 0, to_sun);
  bound_packets();
}

glm::vec3 IntervalRays::normal(const SurfaceSample& sample) const noexcept {
  if (sample.entity < 0) return sample.normal;
  return placed(static_cast<std::size_t>(sample.entity), middle_ray_).rel_from_body * sample.normal;
}

glm::vec3 IntervalRays::position_m(const SurfaceSample& sample) const noexcept {
  if (sample.entity < 0) return sample.position_m;
  const EntityPlacement& place = placed(static_cast<std::size_t>(sample.entity), middle_ray_);
  return place.rel_from_body * sample.position_m + place.position_m;
}

bool IntervalRays::comes_near(const glm::vec3& start_m, float apart_m, std::size_t entity,
                              std::size_t packet) const noexcept {
  const Reach& ball = reach(entity, packet);
  if (ball.radius_m < 0.0F) return false;
  const glm::vec3& direction = direction_[packet * kPacketRays];
  const glm::vec3 to_centre_m = ball.centre_m - start_m;
  const float distance_m = glm::length(to_centre_m);
  const float along_m = std::max(glm::dot(to_centre_m, direction), 0.0F);
  // Bound how far rays stray from the first direction: they matter only up to the far side of the
  // ball.
  const float far_m = distance_m + ball.radius_m + apart_m;
  const float stray_m = apart_m + spread_sine_[packet] * far_m + kRoundingFrac * far_m;
  const glm::vec3 aside_m = to_centre_m - along_m * direction;
  const float reach_m = ball.radius_m + stray_m;
  return glm::dot(aside_m, aside_m) <= reach_m * reach_m;
}

IntervalRays::Spots IntervalRays::send(const CasterRays& rays, const SurfaceSample& face,
                                       std::span<const glm::vec3> starts_m,
                                       std::size_t first) const noexcept {
  std::array<CasterRay, kPacketRays> sent;
  std::array<CasterRay, kPacketRays> in_body;
  Spots spots;
  // Aim the rays of those points whose face looks towards the sun at their instant.
  for (std::size_t k = 0; k < starts_m.size(); ++k) {
    const std::size_t ray = first + k;
    glm::vec3 n = face.normal;
    glm::vec3 start_m = starts_m[k];
    if (face.entity >= 0) {
      const EntityPlacement& place = placed(static_cast<std::size_t>(face.entity), ray);
      // Trace the own hull in the axes of the body, because float32 loses it where the body is far
      // off. Lift the start for everything else by what is lost there.
      in_body[k] = {start_m, direction_[ray] * place.rel_from_body};
      n = place.rel_from_body * n;
      start_m = place.rel_from_body * start_m + place.position_m;
      start_m += ray_rounding_m(start_m) * n;
    }
    if (!(glm::dot(n, direction_[ray]) > 0.0F)) continue;
    spots.faced |= 1U << k;
    sent[k] = {start_m, direction_[ray]};
  }
  if (spots.faced == 0) return spots;
  // Trace them against static geometry.
  const std::span<const CasterRay> packet(sent.data(), starts_m.size());
  spots.open = spots.faced & ~rays.blocked_static(packet, spots.faced);
  spots.lit = spots.open;
  if (!any_entity_on_) return spots;
  // Trace those that are left against the own hull, and against the entities whose ball they may
  // hit.
  const auto own = static_cast<std::size_t>(face.entity);
  if (face.entity >= 0 && placed(own, first).on) {
    spots.lit &= ~rays.blocked_in_body(own, {in_body.data(), starts_m.size()}, spots.lit);
  }
  const glm::vec3& from_m = sent[static_cast<std::size_t>(std::countr_zero(spots.faced))].origin_m;
  float apart_m = 0.0F;
  for (std::size_t k = 0; k < packet.size(); ++k) {
    if (((spots.faced >> k) & 1U) == 0U) continue;
    apart_m = std::max(apart_m, glm::distance(packet[k].origin_m, from_m));
  }
  for (std::size_t m = 0; m < entity_radius_m_.size() && spots.lit != 0; ++m) {
    if (static_cast<std::int64_t>(m) == face.entity) continue;
    if (!comes_near(from_m, apart_m, m, first / kPacketRays)) continue;
    spots.lit &= ~rays.blocked_moving(m, placed_in_packet(m, first), packet, spots.lit);
  }
  return spots;
}

IntervalRays::Carried IntervalRays::carried(const glm::vec3& at_body_m, std::int32_t entity,
                                            std::size_t packet) const noexcept {
  if (entity < 0) return {at_body_m, 0.0F};
  const auto own = static_cast<std::size_t>(entity);
  const EntityPlacement& place = placed(own, packet * kPacketRays);
  return {place.rel_from_body * at_body_m + place.position_m, 2.0F * reach(own, packet).way_m};
}

bool IntervalRays::may_pass(const SurfaceSample& sample, const glm::vec3& start_m,
                            float apart_m) const noexcept {
  if (short_ || !any_entity_on_) return false;
  for (std::size_t packet = 1; packet < kSunRays / kPacketRays; ++packet) {
    const Carried from = carried(start_m, sample.entity, packet);
    for (std::size_t m = 0; m < entity_radius_m_.size(); ++m) {
      if (static_cast<std::int64_t>(m) == sample.entity || !reach(m, packet).changes) continue;
      if (comes_near(from.at_m, apart_m + from.way_m, m, packet)) return true;
    }
  }
  return false;
}

bool IntervalRays::touches(std::size_t entity, const glm::vec3& centre_m, float around_m,
                           std::int32_t own) const noexcept {
  for (std::size_t packet = 0; packet < kSunRays / kPacketRays; ++packet) {
    const Reach& ball = reach(entity, packet);
    if (ball.radius_m < 0.0F) continue;
    const Carried from = carried(centre_m, own, packet);
    const float apart_m = around_m + from.way_m;
    if (sun_up_ && comes_near(from.at_m, apart_m, entity, packet)) return true;
    // Compare the hidden share of the sky with its limit. A ball hides (radius / distance)^2 *
    // height / distance of the sky of level ground.
    const glm::vec3 aside_m = ball.centre_m - from.at_m;
    const float away_m = std::max(glm::length(aside_m) - ball.way_m - apart_m, 0.0F);
    const float radius_m = entity_radius_m_[entity];
    const float height_m = std::abs(aside_m.z) + ball.way_m + apart_m + 0.5F * radius_m;
    if (kMaxHiddenFrac * away_m * away_m * away_m <= radius_m * radius_m * height_m) return true;
  }
  return false;
}

SunShare IntervalRays::sun_share(const CasterRays& rays, const SurfaceSample& sample,
                                 float start_offset_m, float blur_m) const noexcept {
  if (!sun_up_) return {};
  const Tangents tangents = tangents_of(sample.normal);
  const glm::vec3 start_m = sample.position_m + start_offset_m * sample.normal;
  const glm::vec3 u_m = blur_m * tangents.u;
  const glm::vec3 v_m = blur_m * tangents.v;
  int faced = 0;
  int lit = 0;
  int open = 0;
  for (std::size_t first = 0; first < kSunRays; first += kPacketRays) {
    // Stop after the first packet if its rays agree and no entity can pass.
    if (first == kPacketRays && (lit == 0 || lit == faced) &&
        !may_pass(sample, start_m, kMaxDeviates * blur_m)) {
      break;
    }
    // Spread the starts along the surface: lateral conduction has blurred old shadows.
    std::array<glm::vec3, kPacketRays> starts_m;
    for (std::size_t k = 0; k < kPacketRays; ++k) {
      starts_m[k] = start_m + spread_[first + k].x * u_m + spread_[first + k].y * v_m;
    }
    const Spots spots = send(rays, sample, starts_m, first);
    faced += std::popcount(spots.faced);
    lit += std::popcount(spots.lit);
    open += std::popcount(sample.entity < 0 ? spots.open : spots.lit);
    if (faced == 0) return {};
  }
  // Take the mean over the rays whose instant had the sun before the face.
  return {static_cast<float>(lit) / static_cast<float>(faced),
          static_cast<float>(open) / static_cast<float>(faced)};
}

IntervalRays::Spots IntervalRays::spots(const CasterRays& rays, const SurfaceSample& face,
                                        std::span<const glm::vec3> points_m,
                                        float start_offset_m) const noexcept {
  EMIT_DCHECK_OP(points_m.size(), <=, kPacketRays);
  if (!sun_up_) return {};
  std::array<glm::vec3, kPacketRays> starts_m;
  for (std::size_t k = 0; k < points_m.size(); ++k) {
    starts_m[k] = points_m[k] + start_offset_m * face.normal;
  }
  return send(rays, face, {starts_m.data(), points_m.size()}, 0);
}

HiddenSky IntervalRays::hidden_sky(const CasterRays& rays, const SurfaceSample& sample,
                                   float start_offset_m) const noexcept {
  // Leave out surfaces of entities: their sky_frac already lacks what their own body hides, seen
  // from where it stood at the warm-up.
  if (!any_entity_on_ || sample.entity >= 0) return {};
  const Tangents tangents = tangents_of(sample.normal);
  const glm::vec3 start_m = sample.position_m + start_offset_m * sample.normal;
  const SkyDirections& local = sky_directions(sky_);
  std::array<CasterRay, kSkyRays> sent;
  std::uint32_t above = 0;  // bits of rays that leave upwards
  std::uint32_t hidden = 0;
  HiddenSky most;
  int by_most = 0;
  for (std::size_t m = 0; m < entity_radius_m_.size(); ++m) {
    // Skip entities that are too far away to hide much sky.
    const float reach_m = kNearRadii * entity_radius_m_[m];
    const Reach& ball = reach(m, 0);
    const float away_m = glm::distance(ball.centre_m, start_m) * (1.0F - kRoundingFrac);
    if (ball.radius_m < 0.0F || away_m > reach_m + ball.way_m) continue;
    // Aim the rays once the first entity is near.
    if (above == 0) {
      for (std::size_t i = 0; i < kSkyRays; ++i) {
        sent[i] = {start_m,
                   local[i].x * tangents.u + local[i].y * tangents.v + local[i].z * sample.normal};
        if (sent[i].direction.z > 0.0F) above |= 1U << i;
      }
      if (above == 0) return {};
    }
    // Trace rays that are still free and at whose instant the entity is near.
    std::uint32_t wanted = 0;
    for (std::size_t i = 0; i < kSkyRays; ++i) {
      const glm::vec3 way = placed(m, i).position_m - start_m;
      if (glm::dot(way, way) <= reach_m * reach_m) wanted |= 1U << i;
    }
    const int by_others = std::popcount(hidden);
    hidden |= rays.blocked_moving(m, placed_in_packet(m, 0), sent, wanted & above & ~hidden);
    if (const int by_this = std::popcount(hidden) - by_others; by_this > by_most) {
      by_most = by_this;
      most.entity = static_cast<std::uint32_t>(m);
    }
  }
  // Take the share of the rays that look to the sky: on a wall these are half of them.
  if (above != 0) {
    most.frac =
        static_cast<float>(std::popcount(hidden)) / static_cast<float>(std::popcount(above));
  }
  return most;
}

}  // namespace emit::renderer
