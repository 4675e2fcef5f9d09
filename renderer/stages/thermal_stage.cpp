// SPDX-License-Identifier: Apache-2.0
#include "stages/thermal_stage.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "emit/scene/sheets.hpp"

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

std::vector<PartHistory> make_part_histories(const scene::ScenarioDesc& scenario,
                                             const scene::SceneGeometry& geometry,
                                             std::vector<std::string>& warnings) {
  std::vector<PartHistory> out;
  const std::vector<std::int32_t> entities = histories_of_objects(scenario);
  for (std::size_t o = 0; o < scenario.objects.size(); ++o) {
    if (entities[o] < 0) continue;
    for (const scene::PartDesc& part : scenario.objects[o].parts) {
      // Collect the materials of its surfaces: that of the part, or what a thin body made of it.
      std::set<std::uint32_t> materials;
      for (const scene::Instance& instance : geometry.instances) {
        if (instance.object != o) continue;
        for (const scene::Submesh& submesh : geometry.meshes[instance.mesh].submeshes) {
          const std::string& name = geometry.materials[submesh.material].name;
          if (name == part.material || name == scene::sheet_name(part.material)) {
            materials.insert(submesh.material);
          }
        }
      }
      if (materials.empty()) {
        warnings.push_back(fmt::format("object '{}', part '{}': no surface has material '{}'",
                                       scenario.objects[o].name, part.name, part.material));
      }
      for (const std::uint32_t material : materials) {
        out.emplace_back(part, static_cast<std::size_t>(entities[o]), material);
      }
    }
  }
  std::ranges::stable_sort(out, {}, &PartHistory::entity);
  return out;
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
