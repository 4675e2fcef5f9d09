// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "draw/light_fit.hpp"
#include "emit/physics/frames.hpp"
#include "emit/scene/scene_desc.hpp"
#include "shared/frame_params.glsl.h"

namespace emit::renderer {

/// Camera part of FrameParams, and the same volume in double for culling and fitting.
struct CameraSetup {
  ViewVolume view;
  double pixel_rad = 0.0;  ///< angle of one pixel at the boresight
};
[[nodiscard]] CameraSetup set_camera(const scene::SensorDesc& sensor, const physics::Pose& pose,
                                     gpu::FrameParams& params) noexcept;

}  // namespace emit::renderer
