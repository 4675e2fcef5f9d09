// SPDX-License-Identifier: Apache-2.0
#include "embree/embree_device.hpp"

#include <embree3/rtcore.h>
#include <fmt/format.h>

namespace emit::embree {

void Release::operator()(RTCDeviceTy* device) const noexcept {
  rtcReleaseDevice(device);
}
void Release::operator()(RTCGeometryTy* geometry) const noexcept {
  rtcReleaseGeometry(geometry);
}
void Release::operator()(RTCSceneTy* scene) const noexcept {
  rtcReleaseScene(scene);
}

physics::Result<Device> make_device() {
  Device device(rtcNewDevice("max_isa=avx2"));
  if (!device) {
    return physics::make_error(physics::ErrorCode::internal,
                               fmt::format("Embree gave no device, error {}",
                                           static_cast<int>(rtcGetDeviceError(nullptr))));
  }
  return device;
}

}  // namespace emit::embree
