// SPDX-License-Identifier: Apache-2.0
#include "ray_set.hpp"

#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include "emit/physics/check.hpp"

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Error of float32 coordinates and of a traversal in float32, as a share of the set's radius. It
/// covers the rounding of start and box (2^-24 each), of the direction over the whole chord, and of
/// a few operations.
constexpr double kFloatErrorFrac = 0x1p-20;

/// Context of one call: the rays in double, by the id of the ray.
struct Query {
  RTCIntersectContext context;  // first member, because Embree returns a pointer to it
  const PreparedRay* rays = nullptr;
  double skipped_m[16] = {};
  double limit_m = 0.0;  ///< distance of the best hit so far, for first_hit
  SetHit* best = nullptr;
  std::uint32_t best_index = 0;
};

/// Returns a context for rays that are coherent or not.
Query make_query(const PreparedRay* rays, bool coherent) noexcept {
  Query query;
  rtcInitIntersectContext(&query.context);
  query.context.flags =
      coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
  query.rays = rays;
  return query;
}

}  // namespace

/// Functions through which Embree reads a set. They decide every candidate in double.
struct SetCallbacks {
  static void bounds(const RTCBoundsFunctionArguments* args) {
    const auto& set = *static_cast<const RaySet*>(args->geometryUserPtr);
    const auto& [a, b, c] = set.triangles_[args->primID];
    const glm::dvec3 low = glm::min(glm::min(a, b), c) - set.pad_m_;
    const glm::dvec3 high = glm::max(glm::max(a, b), c) + set.pad_m_;
    RTCBounds& box = *args->bounds_o;
    box.lower_x = static_cast<float>(low.x);  // the padding covers this rounding
    box.lower_y = static_cast<float>(low.y);
    box.lower_z = static_cast<float>(low.z);
    box.upper_x = static_cast<float>(high.x);
    box.upper_y = static_cast<float>(high.y);
    box.upper_z = static_cast<float>(high.z);
  }

  static void occluded(const RTCOccludedFunctionNArguments* args) {
    const auto& set = *static_cast<const RaySet*>(args->geometryUserPtr);
    const auto& query = *reinterpret_cast<const Query*>(args->context);
    const auto& [a, b, c] = set.triangles_[args->primID];
    for (unsigned int i = 0; i < args->N; ++i) {
      if (args->valid[i] == 0) continue;
      TriangleHit hit;
      if (intersect(query.rays[RTCRayN_id(args->ray, args->N, i)], a, b, c, hit)) {
        RTCRayN_tfar(args->ray, args->N, i) = -kInfinity;
      }
    }
  }

  static void first_hit(const RTCIntersectFunctionNArguments* args) {
    const auto& set = *static_cast<const RaySet*>(args->geometryUserPtr);
    auto& query = *reinterpret_cast<Query*>(args->context);
    const auto& [a, b, c] = set.triangles_[args->primID];
    RTCRayN* ray = RTCRayHitN_RayN(args->rayhit, args->N);
    RTCHitN* record = RTCRayHitN_HitN(args->rayhit, args->N);
    for (unsigned int i = 0; i < args->N; ++i) {
      if (args->valid[i] == 0) continue;
      TriangleHit hit;
      if (!intersect(query.rays[RTCRayN_id(ray, args->N, i)], a, b, c, hit)) continue;
      const bool nearer = hit.distance_m < query.limit_m ||
                          (hit.distance_m == query.limit_m && args->primID < query.best_index);
      if (!nearer) continue;
      query.limit_m = hit.distance_m;
      query.best_index = args->primID;
      *query.best = {hit, args->primID};
      // Let candidates come that are as near as this one to within the traversal's error.
      RTCRayN_tfar(ray, args->N, i) = static_cast<float>(
          (hit.distance_m - query.skipped_m[0]) * (1.0 + kFloatErrorFrac) + 2.0 * set.pad_m_);
      RTCHitN_geomID(record, args->N, i) = args->geomID;
      RTCHitN_primID(record, args->N, i) = args->primID;
    }
  }
};

Result<std::unique_ptr<RaySet>> RaySet::create(RTCDeviceTy* device, Builder builder,
                                               RayArithmetic arithmetic) {
  std::unique_ptr<RaySet> set(new RaySet);
  set->arithmetic_ = arithmetic;
  set->triangles_ = std::move(builder.triangles);
  set->sources_ = std::move(builder.sources);
  if (set->triangles_.empty()) return set;
  if (set->triangles_.size() > 0xfffffff0U) {
    return make_error(ErrorCode::invalid_argument, "more triangles than a hierarchy can number");
  }

  // Move the origin to the middle of the triangles.
  glm::dvec3 low{std::numeric_limits<double>::infinity()};
  glm::dvec3 high = -low;
  for (const auto& triangle : set->triangles_) {
    for (const glm::dvec3& corner : triangle) {
      low = glm::min(low, corner);
      high = glm::max(high, corner);
    }
  }
  set->origin_m_ = low + 0.5 * (high - low);
  // Compute the radius around the origin and the padding of the boxes.
  double radius2 = 0.0;
  for (auto& triangle : set->triangles_) {
    for (glm::dvec3& corner : triangle) {
      corner -= set->origin_m_;
      radius2 = std::max(radius2, glm::dot(corner, corner));
    }
  }
  set->radius_m_ = std::sqrt(radius2) * (1.0 + 1e-12);
  set->pad_m_ = kFloatErrorFrac * set->radius_m_;
  if (!(set->radius_m_ < 1e15)) {
    return make_error(ErrorCode::invalid_argument, "a scene wider than 1e15 m cannot be traced");
  }

  // Describe the triangles to Embree: by callbacks in exact arithmetic, else as float32 buffers.
  set->scene_.reset(rtcNewScene(device));
  rtcSetSceneFlags(set->scene_.get(), RTC_SCENE_FLAG_ROBUST);
  const auto count = static_cast<unsigned int>(set->triangles_.size());
  RTCGeometry geometry = nullptr;
  if (arithmetic == RayArithmetic::exact) {
    geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, count);
    rtcSetGeometryUserData(geometry, set.get());
    rtcSetGeometryBoundsFunction(geometry, SetCallbacks::bounds, nullptr);
    rtcSetGeometryOccludedFunction(geometry, SetCallbacks::occluded);
    rtcSetGeometryIntersectFunction(geometry, SetCallbacks::first_hit);
  } else {
    geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                3 * sizeof(float), 3 * std::size_t{count}));
    auto* indices = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t), count));
    if (vertices == nullptr || indices == nullptr) {
      rtcReleaseGeometry(geometry);
      return make_error(ErrorCode::internal, "Embree could not allocate the triangles");
    }
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t corner = 0; corner < 3; ++corner) {
        for (int axis = 0; axis < 3; ++axis) {
          vertices[9 * i + 3 * corner + static_cast<std::size_t>(axis)] =
              static_cast<float>(set->triangles_[i][corner][axis]);
        }
        indices[3 * i + corner] = static_cast<std::uint32_t>(3 * i + corner);
      }
    }
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(set->scene_.get(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(set->scene_.get());
  if (const RTCError error = rtcGetDeviceError(device); error != RTC_ERROR_NONE) {
    return make_error(ErrorCode::internal, fmt::format("Embree could not build the hierarchy of {} "
                                                       "triangles, error {}",
                                                       count, static_cast<int>(error)));
  }
  set->cone_tree_ = ConeTree(set->triangles_);
  return set;
}

/// Moves the start of a ray to the point where it enters the ball around the set, so that its
/// coordinates fit float32 as well as those of the set. Returns false if the ray misses the ball.
bool RaySet::enter(const PreparedRay& ray, glm::dvec3& start_m, double& skipped_m) const noexcept {
  const double radius_m = radius_m_ + pad_m_;
  const double length2 = glm::dot(ray.direction, ray.direction);
  // Find the point of the ray nearest to the centre, then half the chord through the ball.
  const double along_m = -glm::dot(ray.origin_m, ray.direction) / length2;
  const glm::dvec3 nearest = ray.origin_m + along_m * ray.direction;
  const double room2 = radius_m * radius_m * (1.0 + 1e-9) - glm::dot(nearest, nearest);
  if (!(room2 >= 0.0)) return false;
  const double half_chord_m = std::sqrt(room2 / length2);
  if (along_m + half_chord_m < 0.0) return false;
  skipped_m = std::max(along_m - half_chord_m, 0.0);
  start_m = ray.origin_m + skipped_m * ray.direction;
  return true;
}

bool RaySet::first_hit(const PreparedRay& ray, double limit_m, SetHit& hit) const {
  glm::dvec3 start_m;
  double skipped_m = 0.0;
  if (empty() || !enter(ray, start_m, skipped_m) || skipped_m > limit_m) return false;
  // Traverse in float32 from the entry point; the callbacks decide in double.
  Query query = make_query(&ray, false);
  query.skipped_m[0] = skipped_m;
  query.limit_m = limit_m;
  query.best_index = 0xffffffffU;
  query.best = &hit;
  RTCRayHit record{};
  record.ray.org_x = static_cast<float>(start_m.x);
  record.ray.org_y = static_cast<float>(start_m.y);
  record.ray.org_z = static_cast<float>(start_m.z);
  record.ray.dir_x = static_cast<float>(ray.direction.x);
  record.ray.dir_y = static_cast<float>(ray.direction.y);
  record.ray.dir_z = static_cast<float>(ray.direction.z);
  record.ray.tnear = arithmetic_ == RayArithmetic::fast ? static_cast<float>(pad_m_) : 0.0F;
  record.ray.tfar =
      limit_m < 1e30
          ? static_cast<float>((limit_m - skipped_m) * (1.0 + kFloatErrorFrac) + 2.0 * pad_m_)
          : kInfinity;
  record.ray.mask = 0xffffffffU;
  record.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  record.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(scene_.get(), &query.context, &record);
  if (record.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
  if (arithmetic_ == RayArithmetic::fast) {
    hit = {{record.ray.tfar + skipped_m, record.hit.u, record.hit.v}, record.hit.primID};
    return hit.triangle.distance_m < limit_m;
  }
  return true;
}

bool RaySet::occluded(const PreparedRay& ray) const {
  glm::dvec3 start_m;
  double skipped_m = 0.0;
  if (empty() || !enter(ray, start_m, skipped_m)) return false;
  Query query = make_query(&ray, false);
  RTCRay record{};
  record.org_x = static_cast<float>(start_m.x);
  record.org_y = static_cast<float>(start_m.y);
  record.org_z = static_cast<float>(start_m.z);
  record.dir_x = static_cast<float>(ray.direction.x);
  record.dir_y = static_cast<float>(ray.direction.y);
  record.dir_z = static_cast<float>(ray.direction.z);
  record.tnear = arithmetic_ == RayArithmetic::fast ? static_cast<float>(pad_m_) : 0.0F;
  record.tfar = kInfinity;
  record.mask = 0xffffffffU;
  rtcOccluded1(scene_.get(), &query.context, &record);
  return record.tfar < 0.0F;
}

void RaySet::occluded_16(std::span<const PreparedRay> rays, std::uint32_t& blocked) const {
  EMIT_DCHECK_OP(rays.size(), <=, 16U);
  if (empty()) return;
  // Pack the rays that are not blocked yet.
  alignas(64) int valid[16] = {};
  alignas(64) RTCRay16 record;
  const float near_m = arithmetic_ == RayArithmetic::fast ? static_cast<float>(pad_m_) : 0.0F;
  bool any = false;
  for (std::size_t i = 0; i < 16; ++i) {
    glm::dvec3 start_m{0.0};
    double skipped_m = 0.0;
    const bool wanted =
        i < rays.size() && ((blocked >> i) & 1U) == 0U && enter(rays[i], start_m, skipped_m);
    const glm::dvec3 direction = i < rays.size() ? rays[i].direction : glm::dvec3(0.0, 0.0, 1.0);
    valid[i] = wanted ? -1 : 0;
    any = any || wanted;
    record.org_x[i] = static_cast<float>(start_m.x);
    record.org_y[i] = static_cast<float>(start_m.y);
    record.org_z[i] = static_cast<float>(start_m.z);
    record.dir_x[i] = static_cast<float>(direction.x);
    record.dir_y[i] = static_cast<float>(direction.y);
    record.dir_z[i] = static_cast<float>(direction.z);
    record.tnear[i] = near_m;
    record.tfar[i] = kInfinity;
    record.time[i] = 0.0F;
    record.mask[i] = 0xffffffffU;
    record.id[i] = static_cast<unsigned int>(i);
    record.flags[i] = 0;
  }
  if (!any) return;
  Query query = make_query(rays.data(), true);
  rtcOccluded16(valid, scene_.get(), &query.context, &record);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (valid[i] != 0 && record.tfar[i] < 0.0F) blocked |= 1U << i;
  }
}

void RaySet::in_cone(const glm::dvec3& apex_m, const glm::dvec3& axis, double semi_angle_rad,
                     std::vector<std::uint32_t>& out) const {
  cone_tree_.query(apex_m, axis, semi_angle_rad, out);
  std::sort(out.begin(), out.end());
}

}  // namespace emit::reference
