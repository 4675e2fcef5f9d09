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

/// thermal.method = "cached": temperatures come from samples of the surface (surface/), drawn with
/// the refined meshes they sit on.
class CachedStage final : public ThermalStage {
 public:
  /// `software`: the device is. Errors: those of CachedSurface::create().
  [[nodiscard]] static physics::Result<std::unique_ptr<ThermalStage>> create(
      const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
      std::vector<FosterMaterial> foster_materials, const SceneHistory& history, bool software);

  physics::Result<void> warm_up(const FrameRequest& request,
                                const WarmUpProgress& progress) override;
  bool cold(const FrameRequest& request) const noexcept override {
    return surface_->stale(request.thermal_time_ns);
  }
  DrawnScene& drawn() noexcept override { return *drawn_; }
  void describe(SceneStats& stats) const noexcept override;
  bool coarse_from(const physics::Pose& camera) const noexcept override;
  void prepare(const FrameRequest& request, CameraSetup& camera,
               gpu::FrameParams& frame) noexcept override;
  const physics::SunPosition& sun_now() const noexcept override { return sun_now_; }
  const physics::Forcing& forcing_now() const noexcept override { return forcing_now_; }
  void upload() noexcept override;
  void bind() const noexcept override;
  [[nodiscard]] bool looks_around() const noexcept override { return false; }
  void draw(const glm::uvec2& size_px, StageTimes& stages, StageClock& clock) noexcept override;

 private:
  /// A place the surface was prepared for, and how far around it that holds.
  struct Eye {
    RefineView::Eye eye;
    double reach_m = 0.0;
  };
  static std::vector<Eye> eyes_around(std::span<const RefineView::Eye> eyes,
                                      const scene::Aabb& static_bounds);
  /// True where the camera stands within reach of one of the places, and points as that does.
  static bool stands_near(const std::vector<Eye>& eyes, const RefineView::Eye& here,
                          double cos_at_least) noexcept;

  CachedStage(const scene::ScenarioDesc& scenario, const scene::Aabb& static_bounds,
              std::vector<Eye> detail_eyes, std::unique_ptr<CachedSurface> surface,
              std::vector<FosterMaterial> foster_materials, const SceneHistory& history,
              std::optional<CachedSurface::Saved> saved, bool visibly_simplified,
              std::optional<ShadePass> shade_pass, bool software);

  scene::SensorDesc sensor_;
  std::uint32_t max_samples_ = 0;  ///< thermal.max_samples
  bool software_ = false;  ///< the device is
  scene::Aabb static_bounds_;
  std::vector<Eye> detail_eyes_;   ///< meshes were simplified for these
  bool visibly_simplified_;        ///< for want of samples
  std::vector<Eye> refined_eyes_;  ///< triangles were cut for these
  std::vector<std::int32_t> history_of_object_;
  const SceneHistory& history_;
  StepPlan plan_;
  SurfaceHistory surface_history_;
  std::unique_ptr<CachedSurface> surface_;
  std::optional<CachedSurface::Saved> saved_;
  std::unique_ptr<DrawnScene> drawn_;
  physics::SunPosition sun_now_;
  physics::Forcing forcing_now_;

  std::array<gl::Buffer, 3> node_buffers_;  ///< by storage of CachedSurface
  std::optional<ShadePass> shade_pass_;     ///< where there are entities
  gl::Buffer shade_buffer_;
};

}  // namespace emit::renderer
