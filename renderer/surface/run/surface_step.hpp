// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>

#include "surface/heat/heat_interval.hpp"
#include "surface/heat/sample_heat.hpp"
#include "surface/heat/surface_samples.hpp"
#include "surface/model/mover_glow.hpp"
#include "surface/rays/caster_rays.hpp"
#include "surface/rays/interval_rays.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer {

/// What every step of a surface takes; all outlive it.
struct SurfaceStep {
  const SurfaceSamples& all;
  const SampleHeat& heat;
  const CasterRays& rays;
  RayOffsets offsets;
  std::span<const MoverFaces> faces;  ///< by entity; empty: entities send what surroundings do
};

/// A sample after a step, and of a sheet the other side, which has the same state.
struct SteppedSample {
  SampleState state;
  SampleOutput output;
  SampleOutput behind;
};

/// Carries sample `index` on over an interval from the state in `sample`; of a sheet the side with
/// the lower index. `begin`: all samples at the interval's begin. Any thread; RT-safe.
void step_sample(const SurfaceStep& step, const IntervalRays& interval_rays,
                 const HeatInterval& interval, std::span<const SampleOutput> begin,
                 std::uint32_t index, SteppedSample& sample) noexcept;

}  // namespace emit::renderer
