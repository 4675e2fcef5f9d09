// SPDX-License-Identifier: Apache-2.0
#include "surface/heat/sample_heat.hpp"

#include "emit/physics/check.hpp"

namespace emit::renderer {

HeatInterval SampleHeat::sized_interval() const {
  HeatInterval interval;
  std::visit([&](const auto& model) { model.size(interval); }, model_);
  return interval;
}

void SampleHeat::prepare(HeatInterval& interval) const noexcept {
  std::visit([&](const auto& model) { model.prepare(interval); }, model_);
}

SampleState SampleHeat::open_start(const SurfaceSample& sample, const glm::vec3& normal,
                                   const SurfaceHistory& history,
                                   std::span<const HeatInterval> tail) const noexcept {
  // Start emit2014 from the temperature of the material alone: it has no spin-up.
  const auto* extended = std::get_if<FosterHeat>(&model_);
  if (extended == nullptr) return std::get_if<Emit2014Heat>(&model_)->start_state(sample);
  // Start foster from the unshadowed spin-up of a face that looks in a direction.
  const auto facing = [&](const glm::vec3& direction) {
    return extended->start_state(
        sample, direction, history.start_states(sample.material, glm::dvec3(direction)), tail);
  };
  SampleState state = facing(normal);
  if (!extended->is_sheet(sample.material)) return state;
  // Average both faces of a sheet: they share one state.
  const SampleState back = facing(-normal);
  for (std::size_t i = 0; i < state.modes_k.size(); ++i) {
    state.modes_k[i] = 0.5 * (state.modes_k[i] + back.modes_k[i]);
  }
  return state;
}

void SampleHeat::hide_start(const SurfaceSample& sample, const glm::vec3& normal,
                            const SurfaceHistory& history, double sun_frac,
                            SampleState& state) const noexcept {
  const auto* extended = std::get_if<FosterHeat>(&model_);
  if (extended == nullptr || extended->is_sheet(sample.material)) return;
  const FaceOpening face{glm::dvec3(normal), sun_frac, static_cast<double>(sample.sky_frac)};
  const physics::FosterState<double> hidden = history.hidden_states(sample.material, face);
  for (std::size_t i = 0; i < hidden.size(); ++i) state.modes_k[i] += hidden[i];
}

SampleOutput SampleHeat::advance(const SurfaceSample& sample, const glm::vec3& normal,
                                 const HeatInterval& interval, const SampleDrive& drive,
                                 SampleState& state, const SheetBack* back) const noexcept {
  SampleAdvance one{&sample, normal, drive, &state, back, {}};
  advance_all({&one, 1}, interval);
  return one.output;
}

void SampleHeat::advance_all(std::span<SampleAdvance> samples,
                             const HeatInterval& interval) const noexcept {
  std::visit([&](const auto& model) { model.advance(samples, interval); }, model_);
}

void SampleHeat::step_response(std::uint32_t material, const ResponseConditions& around,
                               std::span<const double> times_s,
                               std::span<double> response_m2k_w) const noexcept {
  EMIT_CHECK_OP(times_s.size(), ==, response_m2k_w.size());
  std::visit(
      [&](const auto& model) { model.step_response(material, around, times_s, response_m2k_w); },
      model_);
}

SampleOutput SampleHeat::output(const SurfaceSample& sample, const glm::vec3& normal,
                                const SurfaceForcing& forcing, const SampleDrive& drive,
                                const SampleState& state) const noexcept {
  // Leave normal and forcing out for emit2014: its output depends on the state and the sun fraction
  // alone.
  if (const auto* published = std::get_if<Emit2014Heat>(&model_)) {
    return published->output(sample, drive, state);
  }
  return std::get_if<FosterHeat>(&model_)->output(sample, normal, forcing, drive, state);
}

}  // namespace emit::renderer
