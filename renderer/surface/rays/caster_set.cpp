// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/caster_set.hpp"

#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <set>

namespace emit::renderer {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
/// Number of triangles that take about as much memory as one instance in the hierarchy.
constexpr std::uint64_t kTrianglesOfInstance = 8;

/// Returns whether all coordinates are finite. Others are left out of the bounds.
bool finite(const glm::vec3& p) noexcept {
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

std::uint64_t triangle_count(const scene::Mesh& mesh) noexcept {
  return mesh.indices.size() / 3;
}

/// Returns the box of the finite vertices of a mesh, in its own axes.
scene::Aabb box_of(const scene::Mesh& mesh) {
  scene::Aabb box;
  for (const glm::vec3& p : mesh.positions_m) {
    if (finite(p)) box.add(glm::dvec3(p));
  }
  return box;
}

/// Checks that every index exists and that Embree can number the triangles.
Result<void> check(std::span<const CasterPart> parts) {
  std::uint64_t total = 0;
  std::set<const scene::Mesh*> checked;
  for (const CasterPart& part : parts) {
    const scene::Mesh& mesh = *part.mesh;
    total += triangle_count(mesh);
    // Check each mesh once, however often it appears.
    if (!checked.insert(&mesh).second) continue;
    for (const std::uint32_t index : mesh.indices) {
      if (index >= mesh.positions_m.size()) {
        return make_error(ErrorCode::invalid_argument,
                          fmt::format("mesh '{}': index {} of {} positions", mesh.name, index,
                                      mesh.positions_m.size()));
      }
    }
  }
  if (total > 0x7fffffffU) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{} triangles are more than a hierarchy can number", total));
  }
  return {};
}

/// Buffers of a triangle geometry, which the caller fills. Embree allocates them with the padding
/// that it needs.
struct TriangleBuffers {
  embree::Geometry geometry;
  glm::vec3* positions_m = nullptr;
  std::uint32_t* indices = nullptr;
};
Result<TriangleBuffers> new_triangles(RTCDeviceTy* device, std::size_t vertices,
                                      std::size_t triangles) {
  TriangleBuffers out;
  out.geometry.reset(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
  out.positions_m = static_cast<glm::vec3*>(
      rtcSetNewGeometryBuffer(out.geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              sizeof(glm::vec3), vertices));
  out.indices = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(out.geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(std::uint32_t), triangles));
  if (out.positions_m == nullptr || out.indices == nullptr) {
    return make_error(ErrorCode::internal,
                      fmt::format("Embree could not allocate {} triangles", triangles));
  }
  return out;
}

/// Returns an empty scene.
embree::Scene new_scene(RTCDeviceTy* device) {
  embree::Scene scene(rtcNewScene(device));
  // Ask for robust traversal: no ray then slips through the edge between two faces.
  rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene.get(), RTC_BUILD_QUALITY_HIGH);
  return scene;
}

/// Fills one packet of 16 rays. Lanes that are not wanted are switched off and repeat the first
/// wanted ray. Returns false if none is wanted.
template <class Packet>
bool fill(std::span<const CasterRay> rays, std::uint32_t wanted, Packet& packet,
          int* valid) noexcept {
  if (wanted == 0) return false;
  const auto first = static_cast<std::size_t>(std::countr_zero(wanted));
  for (std::size_t i = 0; i < CasterRays::kMaxRays; ++i) {
    const bool on = i < rays.size() && ((wanted >> i) & 1U) != 0U;
    const CasterRay& ray = rays[on ? i : first];
    valid[i] = on ? -1 : 0;
    packet.org_x[i] = ray.origin_m.x;
    packet.org_y[i] = ray.origin_m.y;
    packet.org_z[i] = ray.origin_m.z;
    packet.dir_x[i] = ray.direction.x;
    packet.dir_y[i] = ray.direction.y;
    packet.dir_z[i] = ray.direction.z;
    packet.tnear[i] = 0.0F;
    packet.tfar[i] = kInfinity;
    packet.time[i] = 0.0F;
    packet.mask[i] = 0xffffffffU;
    packet.id[i] = 0;
    packet.flags[i] = 0;
  }
  return true;
}

/// Returns the context for rays that are alike in origin or direction, which Embree traces faster.
RTCIntersectContext coherent_context() noexcept {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  return context;
}

}  // namespace

scene::Aabb bounds_of(std::span<const CasterPart> parts) {
  std::map<const scene::Mesh*, scene::Aabb> boxes;
  scene::Aabb all;
  for (const CasterPart& part : parts) {
    // Measure each mesh once and transform its box.
    const auto [entry, added] = boxes.try_emplace(part.mesh);
    if (added) entry->second = box_of(*part.mesh);
    if (!entry->second.empty()) all.add(scene::transformed(entry->second, part.frame_from_mesh));
  }
  return all;
}

Result<void> CasterSet::add_flat(RTCDeviceTy* device, std::span<const CasterPart> parts,
                                 const glm::dvec3& origin_m) {
  std::size_t vertices = 0;
  std::size_t triangles = 0;
  for (const CasterPart& part : parts) {
    vertices += part.mesh->positions_m.size();
    triangles += triangle_count(*part.mesh);
  }
  if (triangles == 0) return {};
  if (vertices > 0xffffffffU) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{} vertices are more than a hierarchy can number", vertices));
  }
  // Copy all parts into one geometry, with vertices in double before they are rounded.
  auto buffers = new_triangles(device, vertices, triangles);
  if (!buffers) return tl::unexpected(std::move(buffers.error()));
  std::uint32_t vertex = 0;
  std::uint32_t triangle = 0;
  for (const CasterPart& part : parts) {
    flat_.push_back({triangle, part.instance});
    const std::uint64_t count = triangle_count(*part.mesh);
    for (std::size_t i = 0; i < 3 * count; ++i) {
      buffers->indices[3 * std::size_t{triangle} + i] = vertex + part.mesh->indices[i];
    }
    triangle += static_cast<std::uint32_t>(count);
    for (const glm::vec3& p : part.mesh->positions_m) {
      buffers->positions_m[vertex++] =
          glm::vec3(glm::dvec3(part.frame_from_mesh * glm::dvec4(glm::dvec3(p), 1.0)) - origin_m);
    }
  }
  rtcCommitGeometry(buffers->geometry.get());
  rtcAttachGeometryByID(scene_.get(), buffers->geometry.get(), 0);
  return {};
}

Result<void> CasterSet::add_shared(RTCDeviceTy* device, std::span<const CasterPart> parts,
                                   const glm::dvec3& origin_m) {
  /// Mesh that is stored once.
  struct Stored {
    embree::Scene scene;
    glm::dvec3 centre_m{0.0};  ///< centre of the mesh; vertices are stored relative to it
  };
  std::map<const scene::Mesh*, Stored> stored;
  for (const CasterPart& part : parts) {
    const auto [entry, added] = stored.try_emplace(part.mesh);
    Stored& mesh = entry->second;
    // Store a new mesh as a scene of its own, relative to its centre: float32 then keeps its
    // detail.
    if (added) {
      const scene::Aabb box = box_of(*part.mesh);
      if (!box.empty()) mesh.centre_m = 0.5 * (box.min_m + box.max_m);
      auto buffers =
          new_triangles(device, part.mesh->positions_m.size(), triangle_count(*part.mesh));
      if (!buffers) return tl::unexpected(std::move(buffers.error()));
      std::copy_n(part.mesh->indices.data(), 3 * triangle_count(*part.mesh), buffers->indices);
      glm::vec3* out = buffers->positions_m;
      for (const glm::vec3& p : part.mesh->positions_m) {
        *out++ = glm::vec3(glm::dvec3(p) - mesh.centre_m);
      }
      mesh.scene = new_scene(device);
      rtcCommitGeometry(buffers->geometry.get());
      rtcAttachGeometry(mesh.scene.get(), buffers->geometry.get());
      rtcCommitScene(mesh.scene.get());
    }
    // Place it by an affine map whose offset includes that centre.
    const glm::dmat3 linear(part.frame_from_mesh);
    const glm::dvec3 position_m =
        glm::dvec3(part.frame_from_mesh * glm::dvec4(mesh.centre_m, 1.0)) - origin_m;
    float columns[12];
    for (glm::length_t column = 0; column < 4; ++column) {
      for (glm::length_t row = 0; row < 3; ++row) {
        columns[3 * column + row] =
            static_cast<float>(column < 3 ? linear[column][row] : position_m[row]);
      }
    }
    const embree::Geometry geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE));
    rtcSetGeometryInstancedScene(geometry.get(), mesh.scene.get());
    rtcSetGeometryTransform(geometry.get(), 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns);
    rtcCommitGeometry(geometry.get());
    shared_.push_back({part.instance, glm::mat3(glm::transpose(glm::inverse(linear)))});
    rtcAttachGeometryByID(scene_.get(), geometry.get(), static_cast<unsigned int>(shared_.size()));
  }
  return {};
}

Result<CasterSet> CasterSet::create(RTCDeviceTy* device, std::span<const CasterPart> parts,
                                    const glm::dvec3& origin_m, std::uint64_t flat_triangles) {
  CasterSet set;
  const scene::Aabb box = bounds_of(parts);
  if (box.empty()) return set;
  if (auto checked = check(parts); !checked) return tl::unexpected(std::move(checked.error()));
  // Bound the set by a ball, with a little room for rounding.
  const double radius_m =
      glm::length(glm::max(glm::abs(box.min_m - origin_m), glm::abs(box.max_m - origin_m)));
  if (!(radius_m < 1e8)) {
    return make_error(ErrorCode::invalid_argument, "a scene wider than 1e8 m cannot be traced");
  }
  set.radius_m_ = static_cast<float>(radius_m * (1.0 + 1e-6));

  // Decide which parts share their triangles: those of large sets that appear more than once and
  // have more triangles than an instance costs.
  std::uint64_t total = 0;
  std::map<const scene::Mesh*, std::size_t> uses;
  for (const CasterPart& part : parts) {
    total += triangle_count(*part.mesh);
    ++uses[part.mesh];
  }
  std::vector<CasterPart> flat;
  std::vector<CasterPart> shared;
  for (const CasterPart& part : parts) {
    const std::uint64_t count = triangle_count(*part.mesh);
    if (count == 0) continue;
    const bool share =
        total > flat_triangles && uses[part.mesh] > 1 && count > kTrianglesOfInstance;
    (share ? shared : flat).push_back(part);
  }
  if (flat.empty() && shared.empty()) return set;

  // Build the hierarchy. Embree keeps the failure of any step until it is asked.
  set.scene_ = new_scene(device);
  if (auto added = set.add_flat(device, flat, origin_m); !added) {
    return tl::unexpected(std::move(added.error()));
  }
  if (auto added = set.add_shared(device, shared, origin_m); !added) {
    return tl::unexpected(std::move(added.error()));
  }
  rtcCommitScene(set.scene_.get());
  if (const RTCError error = rtcGetDeviceError(device); error != RTC_ERROR_NONE) {
    return make_error(ErrorCode::internal,
                      fmt::format("Embree could not build the hierarchy of {} triangles, error {}",
                                  total, static_cast<int>(error)));
  }
  return set;
}

std::uint32_t CasterSet::occluded(std::span<const CasterRay> rays,
                                  std::uint32_t wanted) const noexcept {
  alignas(64) int valid[CasterRays::kMaxRays];
  alignas(64) RTCRay16 packet;
  if (!scene_ || !fill(rays, wanted, packet, valid)) return 0;
  // Trace the packet. Embree sets tfar of a blocked ray to minus infinity.
  RTCIntersectContext context = coherent_context();
  rtcOccluded16(valid, scene_.get(), &context, &packet);
  std::uint32_t blocked = 0;
  for (std::size_t i = 0; i < CasterRays::kMaxRays; ++i) {
    blocked |= (valid[i] != 0 && packet.tfar[i] < 0.0F ? 1U : 0U) << i;
  }
  return blocked;
}

std::uint32_t CasterSet::nearest(std::span<const CasterRay> rays, std::uint32_t wanted,
                                 std::span<const float> limits_m,
                                 std::span<CasterHit> hits) const noexcept {
  alignas(64) int valid[CasterRays::kMaxRays];
  alignas(64) RTCRayHit16 packet;
  if (!scene_ || !fill(rays, wanted, packet.ray, valid)) return 0;
  for (std::size_t i = 0; i < CasterRays::kMaxRays; ++i) {
    // Limit the length of each ray and clear the ids, so that a lane without a hit keeps the
    // invalid id.
    if (i < limits_m.size()) packet.ray.tfar[i] = limits_m[i];
    packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  RTCIntersectContext context = coherent_context();
  rtcIntersect16(valid, scene_.get(), &context, &packet);
  std::uint32_t found = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (valid[i] == 0 || packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
    found |= 1U << i;
    CasterHit& hit = hits[i];
    glm::vec3 normal(packet.hit.Ng_x[i], packet.hit.Ng_y[i], packet.hit.Ng_z[i]);
    hit.triangle = packet.hit.primID[i];
    // Find the instance: by the id of a shared mesh, else by the range of the flat list that has
    // the triangle.
    if (const unsigned int id = packet.hit.instID[0][i]; id != RTC_INVALID_GEOMETRY_ID) {
      const Shared& shared = shared_[id - 1];
      hit.instance = shared.instance;
      normal = shared.normal_from_mesh * normal;
    } else {
      const auto after = std::upper_bound(
          flat_.begin(), flat_.end(), hit.triangle,
          [](std::uint32_t triangle, const FlatRange& range) { return triangle < range.first; });
      const FlatRange& range = *(after - 1);
      hit.instance = range.instance;
      hit.triangle -= range.first;
    }
    // Scale by the largest component first: the squared length of a cross product of millimetre
    // edges would leave the range of float32.
    normal /= std::max({std::abs(normal.x), std::abs(normal.y), std::abs(normal.z), 1e-37F});
    hit.normal = glm::normalize(normal);
    hit.front = glm::dot(hit.normal, rays[i].direction) < 0.0F;
    hit.barycentric = {packet.hit.u[i], packet.hit.v[i]};
    hit.distance_m = packet.ray.tfar[i];
  }
  return found;
}

}  // namespace emit::renderer
