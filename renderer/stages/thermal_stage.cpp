// SPDX-License-Identifier: Apache-2.0
#include "stages/thermal_stage.hpp"

namespace emit::renderer {

void StageClock::start() noexcept {
  if (!enabled_) return;
  // Wait for the device, so that work of the previous frame is not counted.
  glFinish();
  last_ = std::chrono::steady_clock::now();
}

void StageClock::mark(double& stage_ms) noexcept {
  if (!enabled_) return;
  // Wait for the device, so that the time belongs to this stage.
  glFinish();
  const auto now = std::chrono::steady_clock::now();
  stage_ms += std::chrono::duration<double, std::milli>(now - last_).count();
  last_ = now;
}

std::vector<std::int32_t> histories_of_objects(const scene::ScenarioDesc& scenario) {
  // Number the objects that are entities in their order.
  std::vector<std::int32_t> out;
  std::int32_t next = 0;
  for (const scene::ObjectDesc& object : scenario.objects) {
    out.push_back(object.entity_id != 0 ? next++ : -1);
  }
  return out;
}

}  // namespace emit::renderer
