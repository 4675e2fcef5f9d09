// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>

#include "gl/objects.hpp"
#include "history/environment.hpp"
#include "shared/frame_params.glsl.h"

namespace emit::renderer {

/// Layer of broken clouds on the device (passes/clouds.glsl). Owner: Renderer. Thread: the one that
/// owns the GL context. Real time: the constructor is setup only, the rest is RT-safe.
class CloudLayer {
 public:
  /// Sends the field to the device.
  explicit CloudLayer(const physics::CloudField& field);

  /// Places the layer for a camera at an instant.
  void update(const physics::CloudField& field, const physics::CloudLight& light,
              const physics::SunPosition& sun, const glm::dvec3& camera_world_m,
              std::int64_t sim_time_ns) noexcept;
  void upload() const noexcept;
  void bind() const noexcept;

 private:
  gpu::CloudParams params_{};
  gl::Buffer buffer_;
  gl::Texture texture_;
};

}  // namespace emit::renderer
