// SPDX-License-Identifier: Apache-2.0
#include "embree/embree_device.hpp"

#include <embree3/rtcore.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>

namespace emit::embree {
namespace {

constexpr std::size_t kRays = 16;

/// Fills the stack below the caller with a pattern, where the next call then finds it.
[[gnu::noinline]] void soil_stack(std::uint8_t pattern) {
  volatile std::uint8_t stack[1U << 17U];
  for (std::size_t i = 0; i < sizeof(stack); ++i) stack[i] = pattern;
}

/// Returns a scene of 4096 small triangles in random places of a cube of 2 m.
Scene triangles(RTCDeviceTy* device, RTCBuildQuality quality) {
  constexpr std::size_t kTriangles = 4096;
  const Geometry geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
  auto* positions_m = static_cast<float*>(
      rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              3 * sizeof(float), 3 * kTriangles));
  auto* indices = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(std::uint32_t), kTriangles));
  std::mt19937 random(7);
  std::uniform_real_distribution<float> place_m(-1.0F, 1.0F);
  std::uniform_real_distribution<float> edge_m(-0.05F, 0.05F);
  for (std::size_t triangle = 0; triangle < kTriangles; ++triangle) {
    const float corner_m[3] = {place_m(random), place_m(random), place_m(random)};
    for (std::size_t vertex = 0; vertex < 3; ++vertex) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        positions_m[9 * triangle + 3 * vertex + axis] = corner_m[axis] + edge_m(random);
      }
      indices[3 * triangle + vertex] = static_cast<std::uint32_t>(3 * triangle + vertex);
    }
  }
  rtcCommitGeometry(geometry.get());
  Scene scene(rtcNewScene(device));
  rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene.get(), quality);
  rtcAttachGeometry(scene.get(), geometry.get());
  rtcCommitScene(scene.get());
  return scene;
}

/// Returns a scene of eight copies of another one, half as large, in the corners of a cube of 2 m.
Scene copies(RTCDeviceTy* device, RTCSceneTy* of, RTCBuildQuality quality) {
  Scene scene(rtcNewScene(device));
  rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene.get(), quality);
  for (unsigned int corner = 0; corner < 8; ++corner) {
    const float scene_from_copy[12] = {0.5F,
                                       0.0F,
                                       0.0F,  // columns
                                       0.0F,
                                       0.5F,
                                       0.0F,  //
                                       0.0F,
                                       0.0F,
                                       0.5F,  //
                                       (corner & 1U) != 0U ? 0.5F : -0.5F,
                                       (corner & 2U) != 0U ? 0.5F : -0.5F,
                                       (corner & 4U) != 0U ? 0.5F : -0.5F};
    const Geometry copy(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE));
    rtcSetGeometryInstancedScene(copy.get(), of);
    rtcSetGeometryTransform(copy.get(), 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, scene_from_copy);
    rtcCommitGeometry(copy.get());
    rtcAttachGeometry(scene.get(), copy.get());
  }
  rtcCommitScene(scene.get());
  return scene;
}

RTCIntersectContext context_of(RTCIntersectContextFlags flags) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = flags;
  return context;
}

/// Returns one ray in +z through the scene, at random beside the axis.
RTCRayHit random_ray(std::mt19937& random) {
  std::uniform_real_distribution<float> place_m(-1.0F, 1.0F);
  RTCRayHit out{};
  out.ray.org_x = place_m(random);
  out.ray.org_y = place_m(random);
  out.ray.org_z = -2.0F;
  out.ray.dir_z = 1.0F;
  out.ray.tfar = std::numeric_limits<float>::infinity();
  out.ray.mask = 0xffffffffU;
  out.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  out.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return out;
}

/// Traces packets of 1 to 16 rays whose answers must be those of the single rays. Returns the
/// number of rays that hit.
std::size_t compare_packets(RTCSceneTy* scene, RTCIntersectContextFlags flags,
                            std::uint8_t pattern) {
  std::mt19937 random(11);
  std::size_t hits = 0;
  for (std::size_t wanted = 1; wanted <= kRays; ++wanted) {
    // Fill the packet and trace each ray alone.
    alignas(64) int valid[kRays] = {};
    alignas(64) RTCRayHit16 packet{};
    float distance_m[kRays];
    for (std::size_t i = 0; i < kRays; ++i) {
      RTCRayHit one = random_ray(random);
      valid[i] = i < wanted ? -1 : 0;
      packet.ray.org_x[i] = one.ray.org_x;
      packet.ray.org_y[i] = one.ray.org_y;
      packet.ray.org_z[i] = one.ray.org_z;
      packet.ray.dir_z[i] = one.ray.dir_z;
      packet.ray.tfar[i] = one.ray.tfar;
      packet.ray.mask[i] = one.ray.mask;
      packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
      RTCIntersectContext context = context_of(RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT);
      rtcIntersect1(scene, &context, &one);
      distance_m[i] = one.ray.tfar;
      if (i < wanted && std::isfinite(one.ray.tfar)) ++hits;
    }
    RTCRay16 shadow = packet.ray;
    // Trace the packet twice, each time on a stack that holds the pattern.
    RTCIntersectContext context = context_of(flags);
    soil_stack(pattern);
    rtcOccluded16(valid, scene, &context, &shadow);
    soil_stack(pattern);
    rtcIntersect16(valid, scene, &context, &packet);
    for (std::size_t i = 0; i < wanted; ++i) {
      EXPECT_EQ(shadow.tfar[i] < 0.0F, std::isfinite(distance_m[i]));
      EXPECT_EQ(packet.ray.tfar[i], distance_m[i]);
    }
  }
  return hits;
}

/// A packet must answer as its single rays do, and must answer at all, whatever the stack held
/// before the call.
TEST(EmbreeDevice, packets_answer_alike_on_any_stack) {
  const auto device = make_device();
  ASSERT_TRUE(device) << device.error().text;
  for (const RTCBuildQuality quality : {RTC_BUILD_QUALITY_MEDIUM, RTC_BUILD_QUALITY_HIGH}) {
    const Scene flat = triangles(device->get(), quality);
    const Scene shared = copies(device->get(), flat.get(), quality);
    for (RTCSceneTy* scene : {flat.get(), shared.get()}) {
      for (const auto flags :
           {RTC_INTERSECT_CONTEXT_FLAG_COHERENT, RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT}) {
        for (const int pattern : {0x00, 0x55, 0xff}) {
          SCOPED_TRACE(testing::Message()
                       << "quality " << quality << ", shared " << (scene == shared.get())
                       << ", flags " << flags << ", pattern " << pattern);
          EXPECT_GT(compare_packets(scene, flags, static_cast<std::uint8_t>(pattern)), 50U);
        }
      }
    }
  }
}

}  // namespace
}  // namespace emit::embree
