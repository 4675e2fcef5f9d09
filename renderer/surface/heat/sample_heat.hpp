// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <utility>
#include <variant>

#include "history/surface_history.hpp"
#include "surface/heat/emit2014_heat.hpp"
#include "surface/heat/foster_heat.hpp"
#include "surface/heat/heat_interval.hpp"
#include "surface/heat/surface_samples.hpp"

namespace emit::renderer {

/// How the thermal model of the scenario carries a sample on. Chosen once, at construction.
/// Immutable after construction; any thread; RT-safe where not said otherwise.
class SampleHeat {
 public:
  explicit SampleHeat(Emit2014Heat model) : model_(std::move(model)) {}
  explicit SampleHeat(FosterHeat model) : model_(std::move(model)) {}

  /// An interval with room for the gains. Allocates.
  [[nodiscard]] HeatInterval sized_interval() const;
  /// Fills the gains of an interval whose forcing stands.
  void prepare(HeatInterval& interval) const noexcept;

  /// Before the first interval of the record; `normal` in world axes at that time.
  [[nodiscard]] SampleState start_state(const SurfaceSample& sample, const glm::vec3& normal,
                                        const SurfaceHistory& history,
                                        std::span<const HeatInterval> tail) const noexcept;

  /// Advances a sample over an interval; `normal` in world axes, in its middle. A sheet is driven
  /// by the mean of what it and its other face receive; both have its state.
  SampleOutput advance(const SurfaceSample& sample, const glm::vec3& normal,
                       const HeatInterval& interval, const SampleDrive& drive, SampleState& state,
                       const SheetBack* back = nullptr) const noexcept;

  /// What a sample of that state sends out at an instant, which `drive` begins with.
  [[nodiscard]] SampleOutput output(const SurfaceSample& sample, const glm::vec3& normal,
                                    const SurfaceForcing& forcing, const SampleDrive& drive,
                                    const SampleState& state) const noexcept;

  /// What a face of open ground gains by each of `times_s` (ascending) after the sun has come out,
  /// K per W/m2 of direct sunlight on it, to first order; zero for sheets and where the temperature
  /// is prescribed. @pre equal lengths
  void step_response(std::uint32_t material, const ResponseConditions& around,
                     std::span<const double> times_s,
                     std::span<double> response_m2k_w) const noexcept;

  /// Which sky a sample feels: every direction of the full sphere alike (emit2014), or by the
  /// cosine to its normal (foster).
  [[nodiscard]] SkyMeasure sky_measure() const noexcept {
    return std::holds_alternative<Emit2014Heat>(model_) ? SkyMeasure::sphere : SkyMeasure::cosine;
  }

 private:
  std::variant<Emit2014Heat, FosterHeat> model_;
};

}  // namespace emit::renderer
