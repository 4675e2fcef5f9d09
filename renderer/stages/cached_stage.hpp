// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "history/step_plan.hpp"
#include "history/surface_history.hpp"
#include "passes/shade_pass.hpp"
#include "stages/thermal_stage.hpp"
#include "surface/run/cached_surface.hpp"

namespace emit::renderer {

/// Stage of thermal.method = "cached". Temperatures live on samples of the surface
/// (renderer/surface) and are drawn with the refined meshes that have the samples as vertices.
class CachedStage final : public ThermalStage {
 public:
  /// Simplifies the meshes, creates the surface and compiles the passes. `lights` outlives the
  /// stage. `clutter` is by material of the geometry; empty: none varies. `software` says that the
  /// device is a CPU. Errors: those of CachedSurface::create(), gpu
  /// (names the shader).
  [[nodiscard]] static physics::Result<std::unique_ptr<ThermalStage>> create(
      const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
      std::vector<FosterMaterial> foster_materials, const SceneHistory& history,
      const BandLights& lights, std::span<const DrawnClutter> clutter, bool software);
  /// True if vertices have what other samples send them in band (SceneVertexArrays::read_seen).
  [[nodiscard]] static bool sees_in_band(const scene::ThermalOptions& options) noexcept {
    return options.method == scene::ThermalMethod::cached &&
           options.model == scene::ThermalModel::foster && options.exchange;
  }

  void plan(std::span<const std::int64_t> thermal_times_ns) override {
    planned_ns_.assign(thermal_times_ns.begin(), thermal_times_ns.end());
  }
  physics::Result<void> warm_up(const FrameRequest& request,
                                const WarmUpProgress& progress) override;
  physics::Result<void> carry_on(const FrameRequest& to, const WarmUpProgress& progress) override;
  bool cold(const FrameRequest& request) const noexcept override {
    return surface_->stale(request.thermal_time_ns);
  }
  DrawnScene& drawn() noexcept override;
  void describe(SceneStats& stats) const noexcept override;
  CoarseReasons coarse_from(const physics::Pose& camera) const noexcept override;
  std::optional<std::uint32_t> nearest_sample(const SurfacePlace& place) const noexcept override;
  SampleReading sample_reading(std::uint32_t sample) const noexcept override;
  void prepare(const FrameRequest& request, CameraSetup& camera,
               gpu::FrameParams& frame) noexcept override;
  const physics::SunPosition& sun_now() const noexcept override { return sun_now_; }
  const physics::Forcing& forcing_now() const noexcept override { return forcing_now_; }
  HeatLimits heat_limits(const FrameRequest& request) const noexcept override;
  void upload() noexcept override;
  void bind() const noexcept override;
  /// False, because a pixel depends on the samples of its own triangle alone.
  [[nodiscard]] bool looks_around() const noexcept override { return false; }
  void draw(const glm::uvec2& size_px, StageTimes& stages, StageClock& clock) noexcept override;

 private:
  /// Position of the camera that the surface was prepared for.
  struct Eye {
    RefineView::Eye eye;
    double reach_m = 0.0;  ///< the preparation holds up to this distance from it
  };
  static std::vector<Eye> eyes_around(std::span<const RefineView::Eye> eyes,
                                      const scene::Aabb& static_bounds);
  /// True where the camera stands within reach of one of the places, and points as that does.
  static bool stands_near(const std::vector<Eye>& eyes, const RefineView::Eye& here,
                          double cos_at_least) noexcept;

  /// Transform to the world of the frame that a sample's coordinates are in, at the latest frame.
  [[nodiscard]] physics::Pose frame_of(const SurfaceSample& sample) const noexcept;

  CachedStage(const scene::ScenarioDesc& scenario, const scene::Aabb& static_bounds,
              std::vector<Eye> detail_eyes, std::unique_ptr<CachedSurface> surface,
              std::vector<FosterMaterial> foster_materials, const SceneHistory& history,
              const BandLights* lights, std::span<const DrawnClutter> clutter,
              std::optional<SavedSurface> saved, bool visibly_simplified,
              std::optional<ShadePass> shade_pass, bool software);

  scene::SensorDesc sensor_;
  std::uint32_t max_samples_ = 0;  ///< thermal.max_samples
  bool software_ = false;          ///< the device is a CPU
  scene::Aabb static_bounds_;
  std::vector<Eye> detail_eyes_;   ///< meshes were simplified for these
  bool visibly_simplified_;        ///< meshes lost visible detail because samples are too few
  std::vector<Eye> refined_eyes_;  ///< triangles were refined for these
  std::vector<std::int32_t> history_of_object_;
  const SceneHistory& history_;
  const BandLights* lights_;  ///< null without sees_in_band()
  std::vector<DrawnClutter> clutter_;
  StepPlan plan_;
  SurfaceHistory surface_history_;
  std::unique_ptr<CachedSurface> surface_;
  std::optional<SavedSurface> saved_;
  std::vector<std::int64_t> planned_ns_;  ///< thermal instants of frames to come
  std::unique_ptr<DrawnScene> drawn_;     ///< null before the first warm_up()
  physics::SunPosition sun_now_;
  physics::Forcing forcing_now_;
  std::int64_t drawn_ns_ = 0;  ///< simulation time of the latest frame, of its entities

  std::array<gl::Buffer, 3> node_buffers_;  ///< one per storage of CachedSurface
  std::array<gl::Buffer, 3> seen_buffers_;  ///< the same; empty without sees_in_band()
  std::optional<ShadePass> shade_pass_;     ///< empty when the scenario has no entities
  gl::Buffer shade_buffer_;                 ///< recent shade of entities by vertex, K
};

}  // namespace emit::renderer
