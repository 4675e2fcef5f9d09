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

/// Thermal model of the scenario, applied to single samples: emit2014 or foster, chosen once at
/// construction. Immutable after construction; any thread; RT-safe if a function does not say
/// otherwise.
class SampleHeat {
 public:
  explicit SampleHeat(Emit2014Heat model) : model_(std::move(model)) {}
  explicit SampleHeat(FosterHeat model) : model_(std::move(model)) {}

  /// Returns an interval with room for the gains of this model. It allocates.
  [[nodiscard]] HeatInterval sized_interval() const;
  /// Fills the gains of an interval whose forcing is already set. The interval must come from
  /// sized_interval().
  void prepare(HeatInterval& interval) const noexcept;

  /// Returns the state of a sample at the start of the record. `normal` is in world axes at that
  /// time. `tail` has the last intervals of the unshadowed spin-up, which only foster uses. A sheet
  /// starts with the mean of its two faces. Nothing hides sun or sky from it.
  [[nodiscard]] SampleState open_start(const SurfaceSample& sample, const glm::vec3& normal,
                                       const SurfaceHistory& history,
                                       std::span<const HeatInterval> tail) const noexcept;
  /// Adds to the state of open_start() what the sample has missed of sun and sky before the record.
  /// `sun_frac` is the share of the sun that has reached it.
  void hide_start(const SurfaceSample& sample, const glm::vec3& normal,
                  const SurfaceHistory& history, double sun_frac,
                  SampleState& state) const noexcept;

  /// Advances a sample over an interval and returns its output at the end. `normal` is in world
  /// axes, in the middle of the interval. `back` is given for a sheet: the mean of the inputs of
  /// both faces drives the one state that they share (physics.md eq. 24).
  SampleOutput advance(const SurfaceSample& sample, const glm::vec3& normal,
                       const HeatInterval& interval, const SampleDrive& drive, SampleState& state,
                       const SheetBack* back = nullptr) const noexcept;

  /// Advances each sample as advance() does, bit for bit, in less time.
  /// @pre `sample` and `state` are set, and no two samples share a state
  void advance_all(std::span<SampleAdvance> samples, const HeatInterval& interval) const noexcept;

  /// Returns the output of a sample in this state at an instant, without a step. `drive` belongs to
  /// an interval that begins at that instant.
  [[nodiscard]] SampleOutput output(const SurfaceSample& sample, const glm::vec3& normal,
                                    const SurfaceForcing& forcing, const SampleDrive& drive,
                                    const SampleState& state) const noexcept;

  /// Computes the step response: the temperature that a face of open ground gains by each of
  /// `times_s` (ascending) after the sun has come out, in K per W/m2 of direct sunlight on it, to
  /// first order. The response is zero for sheets and for prescribed temperatures.
  /// @pre `times_s` and `response_m2k_w` have equal lengths
  void step_response(std::uint32_t material, const ResponseConditions& around,
                     std::span<const double> times_s,
                     std::span<double> response_m2k_w) const noexcept;

  /// Returns whether a material rests on the interior of its body. With emit2014 none does.
  [[nodiscard]] bool rests_on_body(std::uint32_t material) const noexcept {
    const auto* foster = std::get_if<FosterHeat>(&model_);
    return foster != nullptr && foster->rests_on_body(material);
  }
  /// Returns whether any material does.
  [[nodiscard]] bool has_bodies() const noexcept {
    const auto* foster = std::get_if<FosterHeat>(&model_);
    return foster != nullptr && foster->has_bodies();
  }
  /// Returns the first of the two twins of a material; 0: it has none.
  [[nodiscard]] std::uint32_t first_twin(std::uint32_t material) const noexcept {
    const auto* foster = std::get_if<FosterHeat>(&model_);
    return foster == nullptr ? 0 : foster->first_twin(material);
  }
  /// Returns whether any material has twins.
  [[nodiscard]] bool has_twins() const noexcept {
    const auto* foster = std::get_if<FosterHeat>(&model_);
    return foster != nullptr && foster->has_twins();
  }
  /// The extended thermal model; null with emit2014.
  [[nodiscard]] const FosterHeat* foster() const noexcept {
    return std::get_if<FosterHeat>(&model_);
  }
  /// The model of bodies. @pre some material rests on a body
  [[nodiscard]] const FosterHeat& of_bodies() const noexcept {
    return *std::get_if<FosterHeat>(&model_);
  }

  /// Returns the measure by which directions of the sky count: all directions of the full sphere
  /// alike (emit2014), or by the cosine to the normal (foster).
  [[nodiscard]] SkyMeasure sky_measure() const noexcept {
    return std::holds_alternative<Emit2014Heat>(model_) ? SkyMeasure::sphere : SkyMeasure::cosine;
  }

 private:
  std::variant<Emit2014Heat, FosterHeat> model_;
};

}  // namespace emit::renderer
