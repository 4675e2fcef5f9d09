// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <vector>

#include "emit/physics/frames.hpp"
#include "emit/scene/scene_desc.hpp"
#include "history/foster_history.hpp"
#include "history/step_plan.hpp"
#include "draw/camera_setup.hpp"
#include "draw/light_fit.hpp"
#include "shared/frame_params.glsl.h"

/// Fills the structs that the shaders read from the plain state of a frame. RT-safe.
namespace emit::renderer {

/// Light frusta, fluxes and sun of one interval. The frusta are fitted around what the camera sees
/// for the sun at the interval's sample.
/// Returns the fitted frusta for culling; count 0 when no map is needed.
[[nodiscard]] LightFrusta set_step(const HistoryInterval& interval, const CameraSetup& camera,
                                   const scene::ThermalOptions& options, bool first, bool last,
                                   std::uint32_t relaxation_offset,
                                   gpu::StepParams& params) noexcept;

/// The interval that stands for the frame's instant alone: sun and shade now.
[[nodiscard]] HistoryInterval instant_interval(const StepPlan& plan,
                                               std::int64_t sim_time_ns) noexcept;

/// Disc samples of the soft shadows: equal areas, golden angle, places along the drift stratified
/// independently of the radius.
[[nodiscard]] gpu::TapParams shadow_taps(std::uint32_t blocker_taps,
                                         std::uint32_t filter_taps) noexcept;

/// The extended model in place of what set_step() filled for emit2014: fluxes, film and air at the
/// two ends of the interval.
void set_foster_forcing(const IntervalForcing& forcing, double reference_k,
                        gpu::StepParams& params) noexcept;
/// Gains of every material over an interval and its splits; EMIT_FOSTER_LEVELS + 1 entries each.
void set_foster_gains(double dt_s, std::span<const FosterMaterial> materials,
                      std::span<gpu::RelaxationParams> params) noexcept;

/// Exact gains of every material over an interval.
void set_relaxation(const HistoryInterval& interval, std::span<const scene::Material> materials,
                    std::span<gpu::RelaxationParams> params) noexcept;

}  // namespace emit::renderer
