// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <vector>

#include "draw/camera_setup.hpp"
#include "draw/light_fit.hpp"
#include "emit/physics/frames.hpp"
#include "emit/scene/scene_desc.hpp"
#include "history/foster_history.hpp"
#include "history/step_plan.hpp"
#include "shared/frame_params.glsl.h"

/// Functions that fill the structs of the shaders from the state of a frame. All are RT-safe.
namespace emit::renderer {

/// Fills sun, fluxes and light frusta of one interval of the history. The frusta are fitted around
/// what the camera sees, for the sun at the sample of the interval. `first` and `last` say where
/// the interval lies in the history; `relaxation_offset` is its first entry in the relaxation
/// table. Returns the frusta for culling; their count is 0 when no shadow map is needed.
/// @pre options.shadow_map_px >= 1; the sun vectors of the interval are of unit length.
[[nodiscard]] LightFrusta set_step(const HistoryInterval& interval, const CameraSetup& camera,
                                   const scene::ThermalOptions& options, bool first, bool last,
                                   std::uint32_t relaxation_offset,
                                   gpu::StepParams& params) noexcept;

/// Interval of no length at the instant of the frame, with the sun and weather of that instant.
[[nodiscard]] HistoryInterval instant_interval(const StepPlan& plan,
                                               std::int64_t sim_time_ns) noexcept;

/// Samples of the sun's disc for the soft shadows. They stand for equal areas, and consecutive ones
/// are a golden angle apart. Their positions along the drift are stratified independently of the
/// radius.
/// @pre Both numbers are 1..EMIT_MAX_TAPS.
[[nodiscard]] gpu::TapParams shadow_taps(std::uint32_t blocker_taps,
                                         std::uint32_t filter_taps) noexcept;

/// Replaces what set_step() filled in for the published model by the drive of the extended model:
/// sun, fluxes, film coefficient and air at both ends of the interval (physics.md eq. 16).
void set_foster_forcing(const IntervalForcing& forcing, double reference_k,
                        gpu::StepParams& params) noexcept;
/// Fills the gains of every material over an interval and over its splits, and its wetness.
/// @pre dt_s >= 0; `params` has EMIT_FOSTER_ENTRIES entries per material.
void set_foster_gains(const IntervalForcing& forcing, std::span<const FosterMaterial> materials,
                      std::span<gpu::RelaxationParams> params) noexcept;

/// Fills the exact gains of every material over an interval (physics.md eq. 6).
/// @pre `params` has one entry per material; the interval does not end before it begins.
void set_relaxation(const HistoryInterval& interval, std::span<const scene::Material> materials,
                    std::span<gpu::RelaxationParams> params) noexcept;

}  // namespace emit::renderer
