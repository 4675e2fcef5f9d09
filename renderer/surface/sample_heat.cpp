// SPDX-License-Identifier: Apache-2.0
#include "surface/sample_heat.hpp"

namespace emit::renderer {

HeatInterval SampleHeat::sized_interval() const {
  HeatInterval interval;
  std::visit([&](const auto& model) { model.size(interval); }, model_);
  return interval;
}

void SampleHeat::prepare(HeatInterval& interval) const noexcept {
  std::visit([&](const auto& model) { model.prepare(interval); }, model_);
}

SampleState SampleHeat::start_state(const SurfaceSample& sample, const glm::vec3& normal,
                                    const SurfaceHistory& history,
                                    std::span<const HeatInterval> tail) const noexcept {
  if (const auto* published = std::get_if<Emit2014Heat>(&model_)) {
    return published->start_state(sample);
  }
  return std::get_if<FosterHeat>(&model_)->start_state(
      sample, normal, history.start_states(sample.material, glm::dvec3(normal)), tail);
}

SampleOutput SampleHeat::advance(const SurfaceSample& sample, const glm::vec3& normal,
                                 const HeatInterval& interval, const SampleDrive& drive,
                                 SampleState& state) const noexcept {
  return std::visit(
      [&](const auto& model) { return model.advance(sample, normal, interval, drive, state); },
      model_);
}

SampleOutput SampleHeat::output(const SurfaceSample& sample, const glm::vec3& normal,
                                const SurfaceForcing& forcing, const SampleDrive& drive,
                                const SampleState& state) const noexcept {
  if (const auto* published = std::get_if<Emit2014Heat>(&model_)) {
    return published->output(sample, drive, state);
  }
  return std::get_if<FosterHeat>(&model_)->output(sample, normal, forcing, drive, state);
}

}  // namespace emit::renderer
