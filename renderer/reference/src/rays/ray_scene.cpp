// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/vector_double4.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

#include <cmath>
#include <limits>
#include <map>

#include "emit/physics/check.hpp"
#include "emit/reference/visibility.hpp"
#include "emit/scene/trajectory.hpp"
#include "ray_scene_impl.hpp"

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

bool finite(const glm::dvec3& p) noexcept {
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

/// Checks the arrays and indices of a description.
Result<void> check(const RaySceneDesc& desc) {
  const auto fail = [](std::string text) {
    return make_error(ErrorCode::invalid_argument, std::move(text));
  };
  for (std::size_t i = 0; i < desc.entities.size(); ++i) {
    if (desc.entities[i].poses.empty()) return fail(fmt::format("entity {} has no pose", i));
  }
  for (std::size_t i = 0; i < desc.meshes.size(); ++i) {
    const RayMesh& mesh = desc.meshes[i];
    const std::size_t triangles = mesh.indices.size() / 3;
    if (mesh.indices.size() % 3 != 0) {
      return fail(fmt::format("mesh {}: {} indices are no triangles", i, mesh.indices.size()));
    }
    for (const std::uint32_t index : mesh.indices) {
      if (index >= mesh.positions_m.size()) {
        return fail(
            fmt::format("mesh {}: index {} of {} positions", i, index, mesh.positions_m.size()));
      }
    }
    if (!mesh.normals.empty() && mesh.normals.size() != mesh.positions_m.size()) {
      return fail(fmt::format("mesh {}: {} normals for {} positions", i, mesh.normals.size(),
                              mesh.positions_m.size()));
    }
    if (mesh.materials.size() > 1 && mesh.materials.size() != triangles) {
      return fail(fmt::format("mesh {}: {} materials for {} triangles", i, mesh.materials.size(),
                              triangles));
    }
    if (mesh.entity != kNoEntity && mesh.entity >= desc.entities.size()) {
      return fail(fmt::format("mesh {}: entity {} of {}", i, mesh.entity, desc.entities.size()));
    }
  }
  return {};
}

/// Returns the set of an entity at a pose.
PlacedEntity placed_at(const RaySet& set, const physics::Pose& pose, bool on) {
  PlacedEntity placed{.set = &set, .pose = pose, .on = on};
  placed.world_from_body = glm::mat3_cast(glm::normalize(pose.world_from_body));
  placed.centre_world_m = pose.position_world_m + placed.world_from_body * set.origin_m();
  return placed;
}

}  // namespace

RaySceneDesc ray_scene_desc(const scene::ScenarioDesc& scenario,
                            const scene::SceneGeometry& geometry) {
  RaySceneDesc desc;
  std::map<std::uint32_t, std::uint32_t> entity_of_object;
  for (std::size_t i = 0; i < geometry.instances.size(); ++i) {
    const scene::Instance& instance = geometry.instances[i];
    const scene::Mesh& mesh = geometry.meshes[instance.mesh];
    RayMesh out;
    out.object = instance.object;
    out.instance = static_cast<std::uint32_t>(i);
    // Make one RayEntity per entity, shared by its instances.
    if (instance.entity_id != 0) {
      const auto [entry, added] = entity_of_object.try_emplace(
          instance.object, static_cast<std::uint32_t>(desc.entities.size()));
      if (added) {
        const scene::ObjectDesc& object = scenario.objects[instance.object];
        RayEntity entity{.entity_id = instance.entity_id, .poses = object.trajectory};
        if (entity.poses.empty()) {
          entity.poses.push_back({.pose = object.instances[instance.placement], .on = object.on});
        }
        desc.entities.push_back(std::move(entity));
      }
      out.entity = entry->second;
    }
    // Transform to the frame of the mesh: the body frame of an entity, else the world frame.
    const glm::dmat4& target_from_mesh =
        instance.entity_id != 0 ? instance.body_from_mesh : instance.world_from_mesh;
    const glm::dmat3 normal_matrix = glm::transpose(glm::inverse(glm::dmat3(target_from_mesh)));
    out.positions_m.reserve(mesh.positions_m.size());
    out.normals.reserve(mesh.normals.size());
    for (const glm::vec3& p : mesh.positions_m) {
      out.positions_m.emplace_back(target_from_mesh * glm::dvec4(glm::dvec3(p), 1.0));
    }
    for (const glm::vec3& n : mesh.normals) {
      out.normals.push_back(glm::normalize(normal_matrix * glm::dvec3(n)));
    }
    out.indices = mesh.indices;
    // Spread the materials of the submeshes over their triangles.
    out.materials.resize(mesh.indices.size() / 3);
    for (const scene::Submesh& submesh : mesh.submeshes) {
      const std::size_t first = submesh.first_index / 3;
      for (std::size_t k = 0; k < submesh.index_count / 3; ++k) {
        out.materials[first + k] = submesh.material;
      }
    }
    desc.meshes.push_back(std::move(out));
  }
  return desc;
}

RayScene::RayScene(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RayScene::RayScene(RayScene&&) noexcept = default;
RayScene& RayScene::operator=(RayScene&&) noexcept = default;
RayScene::~RayScene() = default;

Result<RayScene> RayScene::create(RaySceneDesc desc, RayArithmetic arithmetic) {
  if (auto checked = check(desc); !checked) return tl::unexpected(std::move(checked.error()));
  auto impl = std::make_unique<Impl>();
  auto device = embree::make_device();
  if (!device) return tl::unexpected(std::move(device.error()));
  impl->device = std::move(*device);
  impl->desc = std::move(desc);
  impl->arithmetic = arithmetic;

  // Sort the triangles into sets: one for everything static, one per entity.
  std::vector<RaySet::Builder> builders(1 + impl->desc.entities.size());
  for (std::size_t m = 0; m < impl->desc.meshes.size(); ++m) {
    const RayMesh& mesh = impl->desc.meshes[m];
    RaySet::Builder& builder = builders[mesh.entity == kNoEntity ? 0 : 1 + mesh.entity];
    for (std::size_t i = 0; i < mesh.indices.size() / 3; ++i) {
      const std::array<glm::dvec3, 3> corners = {mesh.positions_m[mesh.indices[3 * i]],
                                                 mesh.positions_m[mesh.indices[3 * i + 1]],
                                                 mesh.positions_m[mesh.indices[3 * i + 2]]};
      if (!finite(corners[0]) || !finite(corners[1]) || !finite(corners[2])) {
        ++impl->dropped;
        continue;
      }
      builder.triangles.push_back(corners);
      builder.sources.push_back({static_cast<std::uint32_t>(m), static_cast<std::uint32_t>(i)});
      ++impl->triangles;
    }
  }
  // Build one hierarchy per set.
  for (std::size_t i = 0; i < builders.size(); ++i) {
    auto set = RaySet::create(impl->device.get(), std::move(builders[i]), arithmetic);
    if (!set) return tl::unexpected(std::move(set.error()));
    if (i == 0) {
      impl->fixed = std::move(*set);
    } else {
      impl->entities.push_back(std::move(*set));
    }
  }
  return RayScene(std::move(impl));
}

SceneInstant RayScene::at(std::int64_t sim_time_ns) const {
  auto instant = std::make_shared<SceneInstant::Impl>();
  instant->scene = impl_.get();
  for (std::size_t i = 0; i < impl_->entities.size(); ++i) {
    const scene::TrajectoryState state =
        scene::trajectory_at(impl_->desc.entities[i].poses, sim_time_ns);
    instant->entities.push_back(placed_at(*impl_->entities[i], state.pose, state.on));
  }
  return SceneInstant(std::move(instant));
}

const RaySceneDesc& RayScene::desc() const noexcept {
  return impl_->desc;
}
std::size_t RayScene::triangles() const noexcept {
  return impl_->triangles;
}
std::size_t RayScene::dropped_triangles() const noexcept {
  return impl_->dropped;
}

// --- queries at one instant ----------------------------------------------------------------------

const physics::Pose& SceneInstant::entity_pose(std::uint32_t entity) const {
  EMIT_CHECK_OP(entity, <, impl_->entities.size());
  return impl_->entities[entity].pose;
}
void SceneInstant::place(std::uint32_t entity, const physics::Pose& pose, bool on) {
  EMIT_CHECK_OP(entity, <, impl_->entities.size());
  if (impl_.use_count() > 1) impl_ = std::make_shared<Impl>(*impl_);
  impl_->entities[entity] = placed_at(*impl_->entities[entity].set, pose, on);
}
bool SceneInstant::entity_on(std::uint32_t entity) const {
  EMIT_CHECK_OP(entity, <, impl_->entities.size());
  return impl_->entities[entity].on;
}

SceneInstant::Corners SceneInstant::triangle(std::uint32_t mesh, std::uint32_t primitive) const {
  EMIT_CHECK_OP(mesh, <, impl_->scene->desc.meshes.size());
  const RayMesh& source = impl_->scene->desc.meshes[mesh];
  EMIT_CHECK_OP(primitive, <, source.indices.size() / 3);
  std::array<glm::dvec3, 3> corners;
  for (std::size_t i = 0; i < 3; ++i) {
    corners[i] = source.positions_m[source.indices[3 * std::size_t{primitive} + i]];
    if (source.entity != kNoEntity) {
      const PlacedEntity& entity = impl_->entities[source.entity];
      corners[i] = entity.pose.position_world_m + entity.world_from_body * corners[i];
    }
  }
  return {corners[0], corners[1], corners[2]};
}

double SceneInstant::Impl::plane_m(const glm::dvec3& point_world_m,
                                   double tolerance_m) const noexcept {
  // Point, corners, origins and turned poses each carry a rounding of half an ulp or two of the
  // largest coordinate involved.
  constexpr double kRoundings = 16.0;
  const auto reach = [](const glm::dvec3& p) {
    return std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
  };
  double reach_m = reach(point_world_m);
  if (!scene->fixed->empty()) {
    reach_m = std::max(reach_m, reach(scene->fixed->origin_m()) + scene->fixed->radius_m());
  }
  return tolerance_m + kRoundings * std::numeric_limits<double>::epsilon() * reach_m;
}

PreparedRay SceneInstant::Impl::in_fixed(const Ray& ray) const noexcept {
  return {ray.origin_world_m - scene->fixed->origin_m(), ray.direction,
          plane_m(ray.origin_world_m, ray.tolerance_m)};
}

PreparedRay SceneInstant::Impl::in_entity(const PlacedEntity& entity,
                                          const Ray& ray) const noexcept {
  // A product vector * matrix applies the transposed matrix, which is the inverse rotation.
  return {(ray.origin_world_m - entity.pose.position_world_m) * entity.world_from_body -
              entity.set->origin_m(),
          ray.direction * entity.world_from_body, plane_m(ray.origin_world_m, ray.tolerance_m)};
}

bool SceneInstant::Impl::near(const PlacedEntity& entity, const Ray& ray) const noexcept {
  if (!entity.on || entity.set->empty()) return false;
  // Test the ray against the ball around the entity.
  const glm::dvec3 to_centre = entity.centre_world_m - ray.origin_world_m;
  const double distance2 = glm::dot(to_centre, to_centre);
  const double radius_m = entity.set->radius_m() * 1.000001;
  if (distance2 <= radius_m * radius_m) return true;
  const double along_m = glm::dot(to_centre, ray.direction);
  return along_m > 0.0 && distance2 - along_m * along_m <= radius_m * radius_m + 1e-9 * distance2;
}

std::uint32_t SceneInstant::Impl::blocked_16(std::span<const Ray> rays) const {
  EMIT_DCHECK_OP(rays.size(), <=, 16U);
  std::array<PreparedRay, 16> prepared;
  const std::uint32_t all = (1U << rays.size()) - 1U;
  std::uint32_t blocked = 0;
  // Test the static set with all rays at once.
  for (std::size_t i = 0; i < rays.size(); ++i) prepared[i] = in_fixed(rays[i]);
  scene->fixed->occluded_16({prepared.data(), rays.size()}, blocked);
  // Test the remaining rays against the entities near them.
  for (const PlacedEntity& entity : entities) {
    if (blocked == all) break;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (((blocked >> i) & 1U) != 0U || !near(entity, rays[i])) continue;
      if (entity.set->occluded(in_entity(entity, rays[i]))) blocked |= 1U << i;
    }
  }
  return blocked;
}

RayHit SceneInstant::Impl::complete(const Ray& ray, const RaySet& set, const SetHit& hit,
                                    const PlacedEntity* entity) const {
  // Find the triangle in the description.
  const TriangleSource source = set.source(hit.index);
  const RayMesh& mesh = scene->desc.meshes[source.mesh];
  const auto& [a, b, c] = set.triangles()[hit.index];
  const double wb = hit.triangle.u;
  const double wc = hit.triangle.v;
  const double wa = 1.0 - wb - wc;
  const auto to_world = [&](const glm::dvec3& v) {
    return entity != nullptr ? entity->world_from_body * v : v;
  };
  RayHit out;
  out.distance_m = hit.triangle.distance_m;
  out.barycentric = {wb, wc};
  out.mesh = source.mesh;
  out.primitive = source.primitive;
  out.object = mesh.object;
  out.instance = mesh.instance;
  out.entity = mesh.entity;
  out.material = mesh.materials.empty()       ? 0
                 : mesh.materials.size() == 1 ? mesh.materials.front()
                                              : mesh.materials[source.primitive];
  // Interpolate the position and move it to the world frame.
  const glm::dvec3 local_m = wa * a + wb * b + wc * c + set.origin_m();
  out.position_world_m = to_world(local_m);
  if (entity != nullptr) out.position_world_m += entity->pose.position_world_m;
  out.geometric_normal = to_world(glm::normalize(glm::cross(b - a, c - a)));
  out.front = glm::dot(out.geometric_normal, ray.direction) < 0.0;
  out.shading_normal = out.geometric_normal;
  // Interpolate the normal, unless the vertex normals cancel.
  if (!mesh.normals.empty()) {
    const std::uint32_t* index = &mesh.indices[3 * std::size_t{source.primitive}];
    const glm::dvec3 mixed =
        wa * mesh.normals[index[0]] + wb * mesh.normals[index[1]] + wc * mesh.normals[index[2]];
    const double length = glm::length(mixed);
    if (length > 1e-6) out.shading_normal = to_world(mixed / length);
  }
  return out;
}

std::optional<RayHit> SceneInstant::first_hit(const Ray& ray) const {
  SetHit hit;
  const RaySet* set = nullptr;
  const PlacedEntity* from = nullptr;
  double limit_m = std::numeric_limits<double>::infinity();
  // Take the hit on static geometry as the limit.
  if (impl_->scene->fixed->first_hit(impl_->in_fixed(ray), limit_m, hit)) {
    set = impl_->scene->fixed.get();
    limit_m = hit.triangle.distance_m;
  }
  // Look for nearer hits on the entities.
  for (const PlacedEntity& entity : impl_->entities) {
    SetHit nearer;
    if (!impl_->near(entity, ray)) continue;
    if (!entity.set->first_hit(impl_->in_entity(entity, ray), limit_m, nearer)) continue;
    hit = nearer;
    set = entity.set;
    from = &entity;
    limit_m = hit.triangle.distance_m;
  }
  if (set == nullptr) return std::nullopt;
  return impl_->complete(ray, *set, hit, from);
}

bool SceneInstant::occluded(const Ray& ray) const {
  if (impl_->scene->fixed->occluded(impl_->in_fixed(ray))) return true;
  for (const PlacedEntity& entity : impl_->entities) {
    if (impl_->near(entity, ray) && entity.set->occluded(impl_->in_entity(entity, ray)))
      return true;
  }
  return false;
}

void SceneInstant::Impl::gather(const SurfacePoint& point, const glm::dvec3& axis,
                                double semi_angle_rad,
                                std::vector<std::array<glm::dvec3, 3>>& out) const {
  thread_local std::vector<std::uint32_t> found;
  const double bound_m = plane_m(point.position_world_m, point.tolerance_m);
  // Widen the cone by the rounding of its axis in another frame.
  const double wide_rad = semi_angle_rad * (1.0 + 1e-9) + 1e-12;
  const auto add = [&](const RaySet& set, const glm::dvec3& apex_m, const glm::dvec3& towards,
                       const glm::dmat3* world_from_set) {
    found.clear();
    set.in_cone(apex_m, towards, wide_rad, found);
    for (const std::uint32_t index : found) {
      const auto& [a, b, c] = set.triangles()[index];
      // Leave out triangles whose plane contains the point.
      if (plane_holds(apex_m, bound_m, a, b, c)) continue;
      std::array<glm::dvec3, 3> corners = {a - apex_m, b - apex_m, c - apex_m};
      if (world_from_set != nullptr) {
        for (glm::dvec3& corner : corners) corner = *world_from_set * corner;
      }
      out.push_back(corners);
    }
  };
  // Search the static set, then every entity in its own frame.
  add(*scene->fixed, point.position_world_m - scene->fixed->origin_m(), axis, nullptr);
  for (const PlacedEntity& entity : entities) {
    if (!entity.on || entity.set->empty()) continue;
    const glm::dvec3 apex_m =
        (point.position_world_m - entity.pose.position_world_m) * entity.world_from_body -
        entity.set->origin_m();
    add(*entity.set, apex_m, axis * entity.world_from_body, &entity.world_from_body);
  }
}

glm::dvec3 SceneInstant::Impl::start_m(const SurfacePoint& point) const noexcept {
  if (scene->arithmetic == RayArithmetic::exact) return point.position_world_m;
  return point.position_world_m + point.normal * (0x1p-18 * scene->fixed->radius_m());
}

}  // namespace emit::reference
