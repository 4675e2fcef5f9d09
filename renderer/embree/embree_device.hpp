// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>

#include "emit/physics/error.hpp"

struct RTCDeviceTy;
struct RTCGeometryTy;
struct RTCSceneTy;

namespace emit::embree {

/// Releases objects of Embree.
struct Release {
  void operator()(RTCDeviceTy* device) const noexcept;
  void operator()(RTCGeometryTy* geometry) const noexcept;
  void operator()(RTCSceneTy* scene) const noexcept;
};
using Device = std::unique_ptr<RTCDeviceTy, Release>;
using Geometry = std::unique_ptr<RTCGeometryTy, Release>;
using Scene = std::unique_ptr<RTCSceneTy, Release>;

/// Creates a device that traces with AVX2 or less. The AVX-512 code of Embree 3.13.5 in Debian 12
/// is faulty: it stores some masks of rays as 16 bits and reads them back as 64. A packet of
/// coherent rays then runs for ever if the stack held something else there before. Without that
/// code the answers are also the same on processors with AVX-512 and on those that only have AVX2.
/// Errors: internal.
[[nodiscard]] physics::Result<Device> make_device();

}  // namespace emit::embree
