// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "history/foster_history.hpp"
#include "history/step_plan.hpp"
#include "passes/thermal_stage.hpp"
#include "surface/cached_surface.hpp"

namespace emit::renderer {

/// thermal.method = "cached": temperatures come from samples of the surface (surface/), drawn with
/// the refined meshes they sit on.
class CachedStage final : public ThermalStage {
 public:
  /// Errors: those of CachedSurface::create().
  [[nodiscard]] static physics::Result<std::unique_ptr<ThermalStage>> create(
      const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
      std::vector<FosterMaterial> foster_materials, const SceneHistory& history);

  physics::Result<void> warm_up(const FrameRequest& request,
                                const WarmUpProgress& progress) override;
  bool cold(const FrameRequest& request) const noexcept override {
    return surface_->stale(request.thermal_time_ns);
  }
  DrawnScene& drawn() noexcept override { return *drawn_; }
  void describe(SceneStats& stats) const noexcept override;
  void prepare(const FrameRequest& request, CameraSetup& camera,
               gpu::FrameParams& frame) noexcept override;
  const physics::SunPosition& sun_now() const noexcept override { return sun_now_; }
  const physics::Forcing& forcing_now() const noexcept override { return forcing_now_; }
  void upload() noexcept override;
  void bind() const noexcept override;
  void draw(StageTimes&, StageClock&) noexcept override {}
  const gl::BufferTexture& material_table() const noexcept override { return material_table_; }

 private:
  CachedStage(const scene::ScenarioDesc& scenario, std::vector<scene::Material> materials,
              std::unique_ptr<CachedSurface> surface, std::vector<FosterMaterial> foster_materials,
              const SceneHistory& history);
  void make_sample_buffers();

  scene::SensorDesc sensor_;
  std::vector<std::int32_t> history_of_object_;
  const SceneHistory& history_;
  StepPlan plan_;
  FosterHistory foster_;
  std::unique_ptr<CachedSurface> surface_;
  std::unique_ptr<DrawnScene> drawn_;
  physics::SunPosition sun_now_;
  physics::Forcing forcing_now_;

  gl::Buffer material_buffer_;
  gl::BufferTexture material_table_;
  std::array<gl::Buffer, 3> node_buffers_;  ///< by storage of CachedSurface
  std::array<gl::BufferTexture, 3> node_tables_;
  gl::Buffer sky_buffer_;
  gl::BufferTexture sky_table_;
};

}  // namespace emit::renderer
