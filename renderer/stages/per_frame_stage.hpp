// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "history/foster_history.hpp"
#include "history/step_plan.hpp"
#include "passes/compute_passes.hpp"
#include "history/foster_setup.hpp"
#include "stages/foster_params.hpp"
#include "passes/raster_passes.hpp"
#include "stages/thermal_stage.hpp"

namespace emit::renderer {

/// thermal.method = "per-frame", the published one: all steps of the history again for every pixel
/// of every frame.
class PerFrameStage final : public ThermalStage {
 public:
  /// Errors: gpu (naming the shader).
  [[nodiscard]] static physics::Result<std::unique_ptr<ThermalStage>> create(
      const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
      std::vector<FosterMaterial> foster_materials, const SceneHistory& history);

  physics::Result<void> warm_up(const FrameRequest&, const WarmUpProgress&) override { return {}; }
  bool cold(const FrameRequest&) const noexcept override { return false; }
  DrawnScene& drawn() noexcept override { return drawn_; }
  void prepare(const FrameRequest& request, CameraSetup& camera,
               gpu::FrameParams& frame) noexcept override;
  const physics::SunPosition& sun_now() const noexcept override { return plan_.sun_now(); }
  const physics::Forcing& forcing_now() const noexcept override { return forcing_now_; }
  void upload() noexcept override;
  void bind() const noexcept override;
  /// Obscurance comes from the pixels' neighbours.
  [[nodiscard]] bool looks_around() const noexcept override { return true; }
  void draw(const glm::uvec2& size_px, StageTimes& stages, StageClock& clock) noexcept override;

 private:
  static constexpr std::size_t kBlockAlignment = 256;  // GL guarantees that no driver asks for more
  /// A step's uniform block, padded so that every step can be bound at its offset.
  struct alignas(kBlockAlignment) StepSlot {
    gpu::StepParams params;
  };
  struct Passes {
    OcclusionPass occlusion;
    ShadowPass shadow;
    ThermalPass thermal;
  };

  PerFrameStage(const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
                std::vector<FosterMaterial> foster_materials, const SceneHistory& history,
                Passes passes);

  void prepare_steps(const FrameRequest& request, CameraSetup& camera) noexcept;
  /// Extended model: fluxes, surroundings and gains of all intervals, spin-up tail included.
  void prepare_foster(bool table_changed) noexcept;
  void bind_step(std::uint32_t step) const noexcept;
  void draw_shadow(std::uint32_t step) noexcept;

  scene::ThermalOptions options_;
  const SceneHistory& history_;
  std::vector<scene::Material> materials_;
  StepPlan plan_;
  std::optional<FosterHistory> foster_;  ///< extended model only
  std::uint32_t tail_steps_ = 0;
  physics::Forcing forcing_now_;
  DrawnScene drawn_;
  Passes passes_;

  std::vector<StepSlot> step_params_;
  std::vector<gpu::RelaxationParams> relaxation_params_;
  std::vector<std::array<CommandRange, 4>> shadow_commands_;
  bool extra_sun_pass_ = false;

  gl::Buffer step_buffer_;
  gl::Buffer relaxation_buffer_;
  gl::Buffer tap_buffer_;
  gl::Buffer material_buffer_;
  gl::Buffer spin_up_buffer_;
  gl::BufferTexture relaxation_table_;
  gl::BufferTexture material_table_;
  gl::BufferTexture spin_up_table_;
};

}  // namespace emit::renderer
