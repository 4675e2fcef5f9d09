// SPDX-License-Identifier: Apache-2.0
#include "draw/camera_setup.hpp"

#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

#include "emit/physics/check.hpp"

namespace emit::renderer {

CameraSetup set_camera(const scene::SensorDesc& sensor, double fov_h_rad, const physics::Pose& pose,
                       gpu::FrameParams& params) noexcept {
  EMIT_CHECK_OP(params.rendered_px.x, >=, 1U);
  EMIT_CHECK_OP(params.rendered_px.y, >=, 1U);
  EMIT_CHECK_OP(sensor.width_px, >=, 1U);
  EMIT_CHECK_OP(sensor.height_px, >=, 1U);
  CameraSetup camera;
  ViewVolume& view = camera.view;
  const glm::dmat3 sensor_from_world =
      physics::sensor_from_body() * glm::transpose(glm::mat3_cast(pose.world_from_body));
  view.relworld_from_sensor = glm::transpose(sensor_from_world);
  view.tan_half_h = std::tan(0.5 * fov_h_rad);
  view.tan_half_v = view.tan_half_h * sensor.height_px / sensor.width_px;
  view.near_m = sensor.near_m;
  camera.pixel_rad = 2.0 * view.tan_half_h / params.rendered_px.x;

  // Project with reversed depth, near / z, and an infinite far plane; w is the boresight distance.
  const glm::dmat4 clip_from_sensor{{1.0 / view.tan_half_h, 0.0, 0.0, 0.0},
                                    {0.0, 1.0 / view.tan_half_v, 0.0, 0.0},
                                    {0.0, 0.0, 0.0, 1.0},
                                    {0.0, 0.0, sensor.near_m, 0.0}};
  view.clip_from_relworld = clip_from_sensor * glm::dmat4(sensor_from_world);
  params.relworld_from_sensor = glm::mat4(glm::dmat4(view.relworld_from_sensor));
  params.ray_per_px = glm::vec2(static_cast<float>(2.0 * view.tan_half_h / params.rendered_px.x),
                                static_cast<float>(2.0 * view.tan_half_v / params.rendered_px.y));
  params.ray_at_corner =
      glm::vec2(static_cast<float>(-view.tan_half_h), static_cast<float>(-view.tan_half_v));
  return camera;
}

}  // namespace emit::renderer
