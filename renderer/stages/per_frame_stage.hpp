// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "history/foster_history.hpp"
#include "history/foster_setup.hpp"
#include "history/step_plan.hpp"
#include "passes/occlusion_pass.hpp"
#include "passes/shadow_pass.hpp"
#include "passes/thermal_pass.hpp"
#include "stages/foster_params.hpp"
#include "stages/thermal_stage.hpp"

namespace emit::renderer {

/// Stage of thermal.method = "per-frame", the published method. Every frame computes all steps of
/// the history again for every pixel.
class PerFrameStage final : public ThermalStage {
 public:
  /// Compiles the passes and allocates the memory of the device. Errors: gpu (names the shader).
  [[nodiscard]] static physics::Result<std::unique_ptr<ThermalStage>> create(
      const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
      std::vector<FosterMaterial> foster_materials, const SceneHistory& history);

  physics::Result<void> warm_up(const FrameRequest&, const WarmUpProgress&) override { return {}; }
  physics::Result<void> carry_on(const FrameRequest&, const WarmUpProgress&) override { return {}; }
  bool cold(const FrameRequest&) const noexcept override { return false; }
  DrawnScene& drawn() noexcept override { return drawn_; }
  void prepare(const FrameRequest& request, CameraSetup& camera,
               gpu::FrameParams& frame) noexcept override;
  const physics::SunPosition& sun_now() const noexcept override { return plan_.sun_now(); }
  const physics::Forcing& forcing_now() const noexcept override { return forcing_now_; }
  HeatLimits heat_limits(const FrameRequest& request) const noexcept override {
    return foster_ ? foster_->surroundings().limits.until(request.thermal_time_ns) : HeatLimits{};
  }
  void upload() noexcept override;
  void bind() const noexcept override;
  /// True, because the obscurance of a pixel comes from its neighbours.
  [[nodiscard]] bool looks_around() const noexcept override { return true; }
  void draw(const glm::uvec2& size_px, StageTimes& stages, StageClock& clock) noexcept override;

 private:
  /// Alignment of uniform blocks. GL guarantees that no driver asks for more.
  static constexpr std::size_t kBlockAlignment = 256;
  /// Uniform block of a step, padded so that every step can be bound at its offset.
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

  /// Fills the intervals of the history and lists the draws into their shadow maps.
  void prepare_steps(const FrameRequest& request, CameraSetup& camera) noexcept;
  /// Fills the drive and the gains of the extended model for all intervals and for the steps of the
  /// spin-up tail.
  void prepare_foster(bool table_changed) noexcept;
  void bind_step(std::uint32_t step) const noexcept;
  /// Binds a step and draws its shadow maps.
  void draw_shadow(std::uint32_t step) noexcept;

  scene::ThermalOptions options_;
  const SceneHistory& history_;
  std::vector<scene::Material> materials_;
  StepPlan plan_;
  std::optional<FosterHistory> foster_;  ///< empty with the published model
  std::uint32_t tail_steps_ = 0;         ///< steps between the spin-up table and the history
  physics::Forcing forcing_now_;
  DrawnScene drawn_;
  Passes passes_;

  std::vector<StepSlot> step_params_;  ///< intervals, the instant of the frame, the spin-up tail
  std::vector<gpu::RelaxationParams> relaxation_params_;
  std::vector<std::array<CommandRange, 4>>
      shadow_commands_;          ///< one entry per step and light frustum
  bool extra_sun_pass_ = false;  ///< the frame needs the shade of its own instant

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
