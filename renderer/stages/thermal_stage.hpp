// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <chrono>
#include <cstdint>
#include <span>

#include "emit/physics/constants.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"
#include "emit/renderer/renderer.hpp"
#include "gl/objects.hpp"
#include "history/environment.hpp"
#include "history/pose_history.hpp"
#include "shared/frame_params.glsl.h"
#include "stages/drawn_scene.hpp"
#include "stages/frame_setup.hpp"

namespace emit::renderer {

/// Time per stage. Enabled, it waits for the device at every mark.
class StageClock {
 public:
  explicit StageClock(bool enabled) : enabled_(enabled) {}
  void start() noexcept;
  /// Adds the time since the last call to `stage_ms`.
  void mark(double& stage_ms) noexcept;

 private:
  bool enabled_;
  std::chrono::steady_clock::time_point last_;
};

/// What the scene is like at any instant, as the host has it.
struct SceneHistory {
  Environment environment;
  std::vector<PoseHistory> entities;
};

/// How surface temperatures come about: one implementation per thermal.method. It owns the geometry
/// that is drawn, because the method decides how fine that is. Owner: Renderer. Real time: all but
/// warm_up() RT-safe.
class ThermalStage {
 public:
  ThermalStage() = default;
  ThermalStage(const ThermalStage&) = delete;
  ThermalStage& operator=(const ThermalStage&) = delete;
  virtual ~ThermalStage() = default;

  /// Setup for frames from `request` on, where the method needs any. Errors as Renderer::warm_up().
  virtual physics::Result<void> warm_up(const FrameRequest& request,
                                        const WarmUpProgress& progress) = 0;
  /// True when a frame of that request would have to wait for warm_up().
  [[nodiscard]] virtual bool cold(const FrameRequest& request) const noexcept = 0;

  [[nodiscard]] virtual DrawnScene& drawn() noexcept = 0;
  /// Adds what the method knows about the scene.
  virtual void describe(SceneStats&) const noexcept {}

  /// True when the surface was not prepared for a camera that stands so.
  [[nodiscard]] virtual bool coarse_from(const physics::Pose& /*camera*/) const noexcept {
    return false;
  }

  /// CPU side of a frame; the lists have begun and the camera's draws are culled. Fills its part of
  /// `frame`.
  virtual void prepare(const FrameRequest& request, CameraSetup& camera,
                       gpu::FrameParams& frame) noexcept = 0;
  /// Sun and weather at the frame's thermal instant, the surroundings' temperature included.
  [[nodiscard]] virtual const physics::SunPosition& sun_now() const noexcept = 0;
  [[nodiscard]] virtual const physics::Forcing& forcing_now() const noexcept = 0;

  virtual void upload() noexcept = 0;
  virtual void bind() const noexcept = 0;
  /// True when pixels within FrameParams::format_window_px depend on what is seen around it.
  [[nodiscard]] virtual bool looks_around() const noexcept = 0;
  /// Everything between geometry and radiance; `size_px`: of FrameParams::format_window_px.
  virtual void draw(const glm::uvec2& size_px, StageTimes& stages, StageClock& clock) noexcept = 0;
};

/// Entries of SceneHistory::entities by object; -1: static.
[[nodiscard]] std::vector<std::int32_t> histories_of_objects(const scene::ScenarioDesc& scenario);

}  // namespace emit::renderer
