// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <chrono>
#include <cstdint>
#include <optional>
#include <span>

#include "emit/physics/constants.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"
#include "emit/renderer/renderer.hpp"
#include "gl/objects.hpp"
#include "history/environment.hpp"
#include "history/part_history.hpp"
#include "history/pose_history.hpp"
#include "shared/frame_params.glsl.h"
#include "stages/drawn_scene.hpp"
#include "stages/frame_setup.hpp"

namespace emit::renderer {

/// Clock that measures the time of each stage of a frame. When it is enabled it waits for the
/// device at every mark; otherwise it does nothing. Thread: the one that owns the GL context.
class StageClock {
 public:
  explicit StageClock(bool enabled) : enabled_(enabled) {}
  /// Starts the measurement of a frame.
  void start() noexcept;
  /// Adds the milliseconds since the last call of start() or mark() to `stage_ms`.
  void mark(double& stage_ms) noexcept;

 private:
  bool enabled_;
  std::chrono::steady_clock::time_point last_;
};

/// State of the scene over time, from the scenario and from what the host has sent.
struct SceneHistory {
  Environment environment;
  std::vector<PoseHistory> entities;
  std::vector<PartHistory> parts;  ///< ascending by entity
};

/// Method that computes surface temperatures (thermal.method). It owns the geometry that is drawn,
/// because the method decides how fine the meshes are.
/// Call order of a frame: prepare(), upload(), bind(), draw().
/// Owner: Renderer. Thread: the one that owns the GL context. Real time: warm_up() and
/// carry_on() are setup only, all other functions are RT-safe.
class ThermalStage {
 public:
  ThermalStage() = default;
  ThermalStage(const ThermalStage&) = delete;
  ThermalStage& operator=(const ThermalStage&) = delete;
  virtual ~ThermalStage() = default;

  /// Implements Renderer::plan(). A method whose frames do not depend on a warm-up ignores it.
  virtual void plan(std::span<const std::int64_t> /*thermal_times_ns*/) {}
  /// Does the work that frames from `request` on need once. Errors: those of Renderer::warm_up().
  virtual physics::Result<void> warm_up(const FrameRequest& request,
                                        const WarmUpProgress& progress) = 0;
  /// Brings the temperatures to the instant of `to`, however far ahead it is. Errors: those of
  /// Renderer::carry_on().
  /// @pre warm_up() has succeeded
  virtual physics::Result<void> carry_on(const FrameRequest& to,
                                         const WarmUpProgress& progress) = 0;
  /// True when a frame of that request would have to wait for warm_up().
  [[nodiscard]] virtual bool cold(const FrameRequest& request) const noexcept = 0;

  /// Geometry that is drawn.
  /// @pre warm_up() has succeeded, if cold() asks for it.
  [[nodiscard]] virtual DrawnScene& drawn() noexcept = 0;
  /// Adds the figures of the method to the statistics of the scene.
  virtual void describe(SceneStats&) const noexcept {}

  /// Implements Renderer::nearest_sample(). A method without samples finds none.
  [[nodiscard]] virtual std::optional<std::uint32_t> nearest_sample(
      const SurfacePlace& /*place*/) const noexcept {
    return std::nullopt;
  }
  /// Implements Renderer::sample_reading().
  [[nodiscard]] virtual SampleReading sample_reading(std::uint32_t /*sample*/) const noexcept {
    return {};
  }

  /// Returns why an image from a camera at this pose may be coarser than asked. RT-safe.
  [[nodiscard]] virtual CoarseReasons coarse_from(const physics::Pose& /*camera*/) const noexcept {
    return {};
  }

  /// Does the work of the CPU for a frame and fills the method's part of `frame`. The draw lists
  /// have begun and the draws of the camera are culled.
  virtual void prepare(const FrameRequest& request, CameraSetup& camera,
                       gpu::FrameParams& frame) noexcept = 0;
  /// Sun at the thermal instant of the frame, after prepare().
  [[nodiscard]] virtual const physics::SunPosition& sun_now() const noexcept = 0;
  /// Weather at the thermal instant of the frame, with the temperature of the surroundings, after
  /// prepare().
  [[nodiscard]] virtual const physics::Forcing& forcing_now() const noexcept = 0;

  /// Limits of the formulae that were passed until the thermal instant of the frame, after
  /// prepare(). Rain on materials without a store is not among them.
  [[nodiscard]] virtual HeatLimits heat_limits(const FrameRequest& request) const noexcept = 0;

  /// Sends the data of the frame to the device.
  virtual void upload() noexcept = 0;
  /// Binds buffers and textures of the method.
  virtual void bind() const noexcept = 0;
  /// True when pixels inside FrameParams::rendered_window_px depend on what is drawn outside it.
  [[nodiscard]] virtual bool looks_around() const noexcept = 0;
  /// Issues the passes between geometry and radiance. The window of the frame has `size_px` pixels.
  virtual void draw(const glm::uvec2& size_px, StageTimes& stages, StageClock& clock) noexcept = 0;
};

/// Makes the histories of the parts of all entities, ascending by entity: one for each material of
/// the geometry that a part has. A part without surfaces adds a line to `warnings`. It allocates.
[[nodiscard]] std::vector<PartHistory> make_part_histories(const scene::ScenarioDesc& scenario,
                                                           const scene::SceneGeometry& geometry,
                                                           std::vector<std::string>& warnings);

/// Entry of SceneHistory::entities for each object of the scenario; -1 for a static object.
[[nodiscard]] std::vector<std::int32_t> histories_of_objects(const scene::ScenarioDesc& scenario);

}  // namespace emit::renderer
