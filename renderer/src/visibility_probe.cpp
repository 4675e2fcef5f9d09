// SPDX-License-Identifier: Apache-2.0
#include "emit/renderer/verify/visibility_probe.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "draw/draw_lists.hpp"
#include "draw/image_window.hpp"
#include "draw/scene_buffers.hpp"
#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "gl/egl_context.hpp"
#include "passes/geometry_pass.hpp"
#include "passes/occlusion_pass.hpp"
#include "passes/shadow_pass.hpp"
#include "passes/thermal_pass.hpp"
#include "stages/frame_setup.hpp"

namespace emit::renderer {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Buffer with `data`, or with one element of zeros, because GL has no empty storage.
template <class T>
gl::Buffer buffer_of(std::span<const T> data) {
  const T nothing{};
  return data.empty() ? gl::Buffer(sizeof(T), &nothing, 0)
                      : gl::Buffer(data.size_bytes(), data.data(), 0);
}

/// Probe on an OpenGL device.
class GlProbe final : public VisibilityProbe {
 public:
  GlProbe(const scene::SensorDesc& sensor, const scene::ThermalOptions& thermal,
          gl::EglContext context, GeometryPass geometry, OcclusionPass occlusion, ShadowPass shadow,
          ThermalPass shade)
      : sensor_(sensor),
        thermal_(thermal),
        context_(std::move(context)),
        geometry_(std::move(geometry)),
        occlusion_(std::move(occlusion)),
        shadow_(std::move(shadow)),
        shade_(std::move(shade)),
        taps_(shadow_taps(thermal.blocker_taps, thermal.filter_taps)) {
    glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
  }

  Result<Answer> at_middle(scene::SceneGeometry geometry, const physics::Pose& sensor_pose,
                           const glm::dvec3& to_sun, double near_m,
                           double obscurance_radius_m) override;

 private:
  /// Value of the middle pixel of the texture on a texture unit.
  [[nodiscard]] double middle(unsigned int unit) const {
    std::vector<float> pixels(std::size_t{sensor_.width_px} * sensor_.height_px);
    glActiveTexture(GL_TEXTURE0 + unit);
    glGetTexImage(GL_TEXTURE_2D, 0, GL_RED, GL_FLOAT, pixels.data());
    return static_cast<double>(
        pixels[std::size_t{sensor_.height_px / 2} * sensor_.width_px + sensor_.width_px / 2]);
  }

  scene::SensorDesc sensor_;
  scene::ThermalOptions thermal_;
  gl::EglContext context_;  ///< declared before every member that owns GL objects
  GeometryPass geometry_;
  OcclusionPass occlusion_;
  ShadowPass shadow_;
  ThermalPass shade_;
  gpu::TapParams taps_;
};

Result<VisibilityProbe::Answer> GlProbe::at_middle(scene::SceneGeometry geometry,
                                                   const physics::Pose& sensor_pose,
                                                   const glm::dvec3& to_sun, double near_m,
                                                   double obscurance_radius_m) {
  EMIT_CHECK_OP(std::abs(glm::dot(to_sun, to_sun) - 1.0), <, 1e-6);
  EMIT_CHECK_OP(near_m, >, 0.0);
  // Send the geometry to the device and start the draw lists.
  const SceneBuffers scene(std::move(geometry));
  const std::array<std::int32_t, 1> no_history{-1};
  DrawLists lists(scene, no_history, thermal_.max_cascades, nullptr);
  lists.begin(sensor_pose.position_world_m, 0, {});

  // Set up the camera as a frame does.
  sensor_.near_m = near_m;
  gpu::FrameParams frame{};
  const glm::uvec2 size_px(sensor_.width_px, sensor_.height_px);
  frame.rendered_px = frame.output_px = size_px;
  frame.rendered_plane_px = frame.output_plane_px = size_px.x * size_px.y;
  frame.rendered_window_px = frame.output_window_px = window_of({}, size_px);
  CameraSetup camera = set_camera(sensor_, sensor_.fov_h_rad, sensor_pose, frame);
  const scene::Aabb& bounds = lists.bounds();
  camera.view.scene_min_m = camera.view.casters_min_m = bounds.min_m;
  camera.view.scene_max_m = camera.view.casters_max_m = bounds.max_m;
  camera.view.far_m =
      std::max(2.0 * near_m, glm::length(glm::max(glm::abs(bounds.min_m), glm::abs(bounds.max_m))));
  CommandRange single_sided;
  CommandRange double_sided;
  lists.cull_view(camera.view, {}, size_px, single_sided, double_sided);
  frame.obscurance_radius_m = static_cast<float>(obscurance_radius_m);

  // Set up one interval with a sun that stands still, and its shadow maps.
  HistoryInterval now;
  now.sun_begin.direction_enu = now.sun_sample.direction_enu = now.sun_end.direction_enu = to_sun;
  now.sun_up = to_sun.z > 0.0;
  gpu::StepParams step{};
  const LightFrusta frusta = set_step(now, camera, thermal_, true, true, 0, step);
  std::array<CommandRange, 4> shadow_commands{};
  for (std::uint32_t c = 0; c < frusta.count; ++c) {
    shadow_commands[c] = lists.cull_light(frusta.cascades[c]);
  }

  // Send and bind everything.
  const gl::Buffer frame_buffer(sizeof(frame), &frame, 0);
  const gl::Buffer step_buffer(sizeof(step), &step, 0);
  const gl::Buffer tap_buffer(sizeof(taps_), &taps_, 0);
  const gl::Buffer records = buffer_of(lists.records());
  const gl::Buffer light_records = buffer_of(lists.light_records());
  const SceneVertexArrays vertices(scene, light_records);
  frame_buffer.bind_uniform(EMIT_BIND_FRAME);
  step_buffer.bind_uniform(EMIT_BIND_STEP);
  tap_buffer.bind_uniform(EMIT_BIND_TAPS);
  geometry_.bind_textures();
  occlusion_.bind_texture();
  shadow_.bind_texture();
  shade_.bind_textures();

  // Run the visibility passes.
  const GeometryPass::View view{single_sided, double_sided, window_of({}, size_px),
                                frame.rendered_window_px};
  geometry_.draw(vertices, lists, records, {&view, 1});
  occlusion_.dispatch(size_px);
  for (std::uint32_t c = 0; c < frusta.count; ++c) {
    shadow_.draw(vertices, c, lists.light_commands(shadow_commands[c]));
  }
  shade_.dispatch_sun_only(size_px);
  glMemoryBarrier(GL_TEXTURE_UPDATE_BARRIER_BIT);

  // Read the middle pixel.
  Answer answer;
  answer.depth_m = middle(EMIT_TEX_DEPTH);
  answer.surface = answer.depth_m < static_cast<double>(EMIT_SKY_DEPTH_M);
  if (answer.surface) {
    answer.sun_frac = middle(EMIT_TEX_SUN_NOW);
    answer.obscurance_frac = middle(EMIT_TEX_OCCLUSION);
  }
  if (glGetError() != GL_NO_ERROR) {
    return make_error(ErrorCode::gpu, "the device refused the visibility passes");
  }
  return answer;
}

}  // namespace

Result<std::unique_ptr<VisibilityProbe>> VisibilityProbe::create(
    const scene::SensorDesc& sensor, const scene::ThermalOptions& thermal,
    const DeviceOptions& device) {
  EMIT_CHECK(sensor.width_px >= 1 && sensor.width_px <= 8192);
  EMIT_CHECK(sensor.height_px >= 1 && sensor.height_px <= 8192);
  EMIT_CHECK(sensor.fov_h_rad > 0.0 && sensor.fov_h_rad < 0.95 * physics::kPi);
  EMIT_CHECK(thermal.shadow_map_px >= 16 && thermal.shadow_map_px <= 16384);
  auto context = gl::EglContext::create(device.gpu_index, device.debug_context);
  if (!context) return tl::unexpected(std::move(context.error()));
  auto geometry =
      GeometryPass::create(*context, {.width_px = sensor.width_px, .height_px = sensor.height_px});
  if (!geometry) return tl::unexpected(std::move(geometry.error()));
  auto occlusion = OcclusionPass::create(sensor.width_px, sensor.height_px);
  if (!occlusion) return tl::unexpected(std::move(occlusion.error()));
  auto shadow = ShadowPass::create(thermal.shadow_map_px, thermal.max_cascades);
  if (!shadow) return tl::unexpected(std::move(shadow.error()));
  auto shade = ThermalPass::create(sensor.width_px, sensor.height_px, thermal, 1);
  if (!shade) return tl::unexpected(std::move(shade.error()));
  return std::make_unique<GlProbe>(sensor, thermal, std::move(*context), std::move(*geometry),
                                   std::move(*occlusion), std::move(*shadow), std::move(*shade));
}

}  // namespace emit::renderer
