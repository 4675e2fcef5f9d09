// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "draw/light_fit.hpp"
#include "emit/physics/frames.hpp"
#include "emit/scene/scene_desc.hpp"
#include "shared/frame_params.glsl.h"

namespace emit::renderer {

/// Camera of a frame in double precision, for culling and for fitting light frusta.
struct CameraSetup {
  ViewVolume view;
  double pixel_rad = 0.0;  ///< angle of one rendered pixel at the boresight
};

/// Sets up the camera for a sensor at a pose and fills the camera's part of `params`. The scene's
/// boxes in the result stay at their defaults. RT-safe.
/// @param fov_h_rad  horizontal field of view, in place of the sensor's
/// @pre params.rendered_px and the sensor's format are at least 1 x 1 pixel.
[[nodiscard]] CameraSetup set_camera(const scene::SensorDesc& sensor, double fov_h_rad,
                                     const physics::Pose& pose, gpu::FrameParams& params) noexcept;

}  // namespace emit::renderer
