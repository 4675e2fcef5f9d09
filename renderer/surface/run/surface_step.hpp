// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

#include "surface/heat/body_view.hpp"
#include "surface/heat/heat_interval.hpp"
#include "surface/heat/sample_heat.hpp"
#include "surface/heat/surface_samples.hpp"
#include "surface/model/entity_exitance.hpp"
#include "surface/rays/caster_rays.hpp"
#include "surface/rays/hot_parts.hpp"
#include "surface/rays/interval_rays.hpp"

namespace emit::renderer {

class ColumnSolve;

/// Number of samples in one task of a parallel loop over samples.
inline constexpr std::size_t kSamplesPerTask = 32;

/// Input that all steps of a surface share. Everything it refers to must outlive it.
struct SurfaceStep {
  const SurfaceSamples& all;
  const SampleHeat& heat;
  const CasterRays& rays;
  std::span<const EntityFaces> faces;  ///< by entity; if empty, entities send what surroundings do
  const HotParts& hot;
  std::span<const double> body_k;  ///< by body: interior, mean over the interval; offsets
  /// Views by entity of what the warm-up did not see there; empty while no entity has moved.
  std::span<const BodyView> views{};
  /// Takes the equations of columns, whose cells it finds together afterwards. Null: each column
  /// advances on its own, with its neighbours as they were at the begin.
  ColumnSolve* columns = nullptr;
};

/// Result of a step of a sample. `behind` is the output of a sheet's other face, which has the same
/// state.
struct SteppedSample {
  SampleState state;
  float bow_k = 0.0F;  ///< see SampleVertex
  SampleOutput output;
  SampleOutput behind;
};

/// States and outputs of all samples at the begin of an interval.
struct SurfaceBegin {
  std::span<const SampleState> states;
  std::span<const SampleOutput> outputs;
};

/// Advances sample `index` over an interval, from the state in `sample`. `begin` holds those of all
/// samples. Any thread; RT-safe.
/// @pre steps_itself(step.all, index): of a sheet it is the face with the lower index
void step_sample(const SurfaceStep& step, const IntervalRays& interval_rays,
                 const HeatInterval& interval, const SurfaceBegin& begin, std::uint32_t index,
                 SteppedSample& sample) noexcept;

}  // namespace emit::renderer
