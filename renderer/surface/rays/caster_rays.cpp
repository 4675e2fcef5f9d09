// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/caster_rays.hpp"

#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "emit/physics/check.hpp"
#include "surface/rays/bulk_bounds.hpp"
#include "surface/rays/caster_set.hpp"

namespace emit::renderer {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Returns the centre of a box, the origin for an empty one.
glm::dvec3 centre(const scene::Aabb& box) noexcept {
  return box.empty() ? glm::dvec3(0.0) : 0.5 * (box.min_m + box.max_m);
}

/// Returns a set bit for every ray.
constexpr std::uint32_t all_of(std::span<const CasterRay> rays) noexcept {
  return (1U << rays.size()) - 1U;
}

using Packet = std::array<CasterRay, CasterRays::kMaxRays>;

/// Cone that holds the rays of a packet. They start within `apart_m` of `origin_m`, and their unit
/// directions end within `spread` of that of `axis`.
struct PacketCone {
  glm::vec3 origin_m{0.0F};
  glm::vec3 axis{0.0F};
  float apart_m = 0.0F;
  float spread = 0.0F;

  explicit PacketCone(std::span<const CasterRay> rays) noexcept : origin_m(rays.front().origin_m) {
    glm::vec3 sum(0.0F);
    for (const CasterRay& ray : rays) sum += ray.direction;
    const float length = glm::length(sum);
    // Take the mean direction as axis. Directions that cancel have none, so any of them serves.
    axis = length > 0.0F ? sum / length : rays.front().direction;
    for (const CasterRay& ray : rays) {
      apart_m = std::max(apart_m, glm::distance(ray.origin_m, origin_m));
      spread = std::max(spread, glm::distance(ray.direction, axis));
    }
  }

  /// Returns false if no ray of the packet can hit a ball.
  [[nodiscard]] bool may_meet(const glm::vec3& centre_m, float radius_m) const noexcept {
    const glm::vec3 to_centre_m = centre_m - origin_m;
    const float distance_m = glm::length(to_centre_m);
    const float along_m = std::max(glm::dot(to_centre_m, axis), 0.0F);
    // Bound how far rays stray from the axis: they matter only up to the far side of the ball.
    const float far_m = distance_m + radius_m + apart_m;
    constexpr float kRoom = 1e-5F;  // room for rounding
    const float reach_m = radius_m + apart_m + (spread + kRoom) * far_m;
    const glm::vec3 aside_m = to_centre_m - along_m * axis;
    return glm::dot(aside_m, aside_m) <= reach_m * reach_m;
  }
};

}  // namespace

struct CasterRays::Impl {
  /// Geometry of one entity, in its body axes.
  struct Entity {
    std::uint32_t object = 0;
    glm::dvec3 centre_body_m{0.0};  ///< origin of the set
    CasterSet set;
  };

  embree::Device device;
  glm::dvec3 origin_world_m{0.0};
  CasterSet fixed;
  std::vector<Entity> entities;

  /// Transforms a ray to the axes and the origin of the set of an entity. Returns false and writes
  /// nothing if the ray passes the ball around the entity.
  [[nodiscard]] static bool enter(const Entity& entity, const EntityPlacement& placement,
                                  const CasterRay& ray, CasterRay& inside) noexcept;
  /// Returns false if no ray of the packet comes near the entity.
  [[nodiscard]] static bool comes_near(const Entity& entity, const EntityPlacement& placement,
                                       const PacketCone& cone) noexcept {
    return placement.on && cone.may_meet(placement.rel_from_body * glm::vec3(entity.centre_body_m) +
                                             placement.position_m,
                                         entity.set.radius_m());
  }
  /// Transforms all rays to the axes of an entity that stands at one place for all of them. Returns
  /// the bits of those that come near it.
  [[nodiscard]] static std::uint32_t enter_all(const Entity& entity,
                                               const EntityPlacement& placement,
                                               std::span<const CasterRay> rays,
                                               Packet& inside) noexcept;
};

bool CasterRays::Impl::enter(const Entity& entity, const EntityPlacement& placement,
                             const CasterRay& ray, CasterRay& inside) noexcept {
  if (!placement.on) return false;
  const glm::vec3 centre_m(entity.centre_body_m);
  const glm::vec3 centre_rel_m = placement.rel_from_body * centre_m + placement.position_m;
  const glm::vec3 to_centre = centre_rel_m - ray.origin_m;
  // Find the point of the ray that is nearest to the centre of the ball.
  const float along_m = std::max(glm::dot(to_centre, ray.direction), 0.0F);
  const glm::vec3 aside = to_centre - along_m * ray.direction;
  // Leave room for the rounding of far-off origins.
  const float reach_m = entity.set.radius_m() + 1e-6F * (along_m + glm::length(to_centre));
  if (glm::dot(aside, aside) > reach_m * reach_m) return false;
  // Apply the inverse rotation: vector * matrix multiplies by the transpose.
  inside = {(ray.origin_m - placement.position_m) * placement.rel_from_body - centre_m,
            ray.direction * placement.rel_from_body};
  return true;
}

std::uint32_t CasterRays::Impl::enter_all(const Entity& entity, const EntityPlacement& placement,
                                          std::span<const CasterRay> rays,
                                          Packet& inside) noexcept {
  std::uint32_t near = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (enter(entity, placement, rays[i], inside[i])) near |= 1U << i;
  }
  return near;
}

CasterRays::CasterRays(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
CasterRays::CasterRays(CasterRays&&) noexcept = default;
CasterRays& CasterRays::operator=(CasterRays&&) noexcept = default;
CasterRays::~CasterRays() = default;

Result<CasterRays> CasterRays::create(const scene::SceneGeometry& geometry,
                                      const std::optional<glm::dvec3>& origin_world_m,
                                      std::uint64_t flat_triangles) {
  auto impl = std::make_unique<Impl>();
  auto device = embree::make_device();
  if (!device) return tl::unexpected(std::move(device.error()));
  impl->device = std::move(*device);
  // Sort the instances: static ones, and those of each entity.
  std::vector<CasterPart> fixed;
  std::vector<CasterPart> everything;  // parts at the placements of the scenario
  std::map<std::uint32_t, std::vector<CasterPart>> moving;
  for (std::size_t i = 0; i < geometry.instances.size(); ++i) {
    const scene::Instance& instance = geometry.instances[i];
    if (instance.mesh >= geometry.meshes.size()) {
      return make_error(
          ErrorCode::invalid_argument,
          fmt::format("instance {}: mesh {} of {}", i, instance.mesh, geometry.meshes.size()));
    }
    CasterPart part{static_cast<std::uint32_t>(i), &geometry.meshes[instance.mesh],
                    instance.world_from_mesh};
    everything.push_back(part);
    if (instance.entity_id == 0) {
      fixed.push_back(part);
    } else {
      part.frame_from_mesh = instance.body_from_mesh;
      moving[instance.object].push_back(part);
    }
  }
  // Choose the origin before the hierarchies: static geometry is stored relative to it.
  impl->origin_world_m =
      origin_world_m ? *origin_world_m : centre(bulk_bounds(fixed.empty() ? everything : fixed));

  // Build one hierarchy for static geometry and one per entity.
  auto set = CasterSet::create(impl->device.get(), fixed, impl->origin_world_m, flat_triangles);
  if (!set) return tl::unexpected(std::move(set.error()).with_context("static geometry"));
  impl->fixed = std::move(*set);
  for (const auto& [object, parts] : moving) {
    Impl::Entity entity{object, centre(bounds_of(parts)), {}};
    auto body = CasterSet::create(impl->device.get(), parts, entity.centre_body_m, flat_triangles);
    if (!body) {
      return tl::unexpected(std::move(body.error()).with_context(fmt::format("object {}", object)));
    }
    entity.set = std::move(*body);
    impl->entities.push_back(std::move(entity));
  }
  return CasterRays(std::move(impl));
}

const glm::dvec3& CasterRays::origin_world_m() const noexcept {
  return impl_->origin_world_m;
}
std::size_t CasterRays::entities() const noexcept {
  return impl_->entities.size();
}
std::uint32_t CasterRays::object_of_entity(std::size_t entity) const noexcept {
  EMIT_CHECK_OP(entity, <, impl_->entities.size());
  return impl_->entities[entity].object;
}

std::uint32_t CasterRays::blocked_static(std::span<const CasterRay> rays,
                                         std::uint32_t wanted) const noexcept {
  EMIT_DCHECK_OP(rays.size(), <=, kMaxRays);
  return impl_->fixed.occluded(rays, all_of(rays) & wanted);
}

std::uint32_t CasterRays::blocked_entity(std::size_t entity, const EntityPlacement& placement,
                                         std::span<const CasterRay> rays) const noexcept {
  EMIT_DCHECK_OP(rays.size(), <=, kMaxRays);
  Packet inside;
  const Impl::Entity& body = impl_->entities[entity];
  const std::uint32_t near = Impl::enter_all(body, placement, rays, inside);
  return near == 0 ? 0 : body.set.occluded({inside.data(), rays.size()}, near);
}

std::uint32_t CasterRays::blocked_moving(std::size_t entity,
                                         std::span<const EntityPlacement> placements,
                                         std::span<const CasterRay> rays,
                                         std::uint32_t wanted) const noexcept {
  EMIT_DCHECK_OP(rays.size(), <=, kMaxRays);
  EMIT_DCHECK_OP(placements.size(), >=, rays.size());
  // Trace all rays in one packet: in the axes of the body they meet the same geometry, wherever the
  // entity stands.
  Packet inside;
  std::uint32_t near = 0;
  const Impl::Entity& body = impl_->entities[entity];
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (((wanted >> i) & 1U) != 0U && Impl::enter(body, placements[i], rays[i], inside[i])) {
      near |= 1U << i;
    }
  }
  return near == 0 ? 0 : body.set.occluded({inside.data(), rays.size()}, near);
}

std::uint32_t CasterRays::blocked_in_body(std::size_t entity, std::span<const CasterRay> rays,
                                          std::uint32_t wanted) const noexcept {
  EMIT_DCHECK_OP(rays.size(), <=, kMaxRays);
  const Impl::Entity& body = impl_->entities[entity];
  const glm::vec3 centre_m(body.centre_body_m);
  Packet inside;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    inside[i] = {rays[i].origin_m - centre_m, rays[i].direction};
  }
  return body.set.occluded({inside.data(), rays.size()}, all_of(rays) & wanted);
}

std::uint32_t CasterRays::blocked(std::span<const CasterRay> rays,
                                  const CasterSelection& selection) const noexcept {
  // Try static geometry first, then the entities until every ray is blocked.
  std::uint32_t blocked = selection.fixed ? blocked_static(rays) : 0;
  const std::size_t count = std::min(selection.entities.size(), impl_->entities.size());
  if (count == 0 || rays.empty()) return blocked;
  const PacketCone cone(rays);
  for (std::size_t m = 0; m < count && blocked != all_of(rays); ++m) {
    if (!Impl::comes_near(impl_->entities[m], selection.entities[m], cone)) continue;
    blocked |= blocked_entity(m, selection.entities[m], rays);
  }
  return blocked;
}

std::optional<CasterHit> CasterRays::first_hit(
    const CasterRay& ray, std::span<const EntityPlacement> entities) const noexcept {
  CasterHit hit;
  if (first_hits({&ray, 1}, {true, entities}, {&hit, 1}) == 0) return std::nullopt;
  return hit;
}

std::uint32_t CasterRays::first_hits(std::span<const CasterRay> rays,
                                     const CasterSelection& selection, std::span<CasterHit> hits,
                                     float within_m) const noexcept {
  EMIT_DCHECK_OP(rays.size(), <=, kMaxRays);
  EMIT_DCHECK_OP(hits.size(), >=, rays.size());
  std::array<float, kMaxRays> limits_m;
  limits_m.fill(within_m);
  std::uint32_t found = 0;
  // Limit each ray to the nearest hit so far, so that farther geometry is not traced.
  const auto shorten = [&](std::uint32_t lanes) {
    found |= lanes;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (((lanes >> i) & 1U) != 0U) limits_m[i] = hits[i].distance_m;
    }
  };
  if (selection.fixed) shorten(impl_->fixed.nearest(rays, all_of(rays), limits_m, hits));
  const std::size_t count = std::min(selection.entities.size(), impl_->entities.size());
  if (count == 0 || rays.empty()) return found;
  const PacketCone cone(rays);
  for (std::size_t m = 0; m < count; ++m) {
    Packet inside;
    const EntityPlacement& placement = selection.entities[m];
    if (!Impl::comes_near(impl_->entities[m], placement, cone)) continue;
    const std::uint32_t near = Impl::enter_all(impl_->entities[m], placement, rays, inside);
    if (near == 0) continue;
    // Trace in the axes of the body, then turn the normals back to rel.
    const std::uint32_t nearer =
        impl_->entities[m].set.nearest({inside.data(), rays.size()}, near, limits_m, hits);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (((nearer >> i) & 1U) != 0U) hits[i].normal = placement.rel_from_body * hits[i].normal;
    }
    shorten(nearer);
  }
  return found;
}

}  // namespace emit::renderer
