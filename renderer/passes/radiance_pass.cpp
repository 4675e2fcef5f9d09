// SPDX-License-Identifier: Apache-2.0
#include "passes/radiance_pass.hpp"

#include <fmt/format.h>

#include <utility>
#include <vector>

#include "emit/physics/check.hpp"
#include "passes/pixel_groups.hpp"
#include "shared/bindings.glsl.h"

namespace emit::renderer {

physics::Result<RadiancePass> RadiancePass::create(const scene::ThermalOptions& options,
                                                   const RadianceContent& content, bool software) {
  EMIT_CHECK_OP(content.bands, >=, 1U);
  EMIT_CHECK_OP(content.bands, <=, std::uint32_t{EMIT_MAX_BANDS});
  RadiancePass pass;
  pass.rows_ = pixel_rows(software);
  std::vector<gl::Define> defines{{"EMIT_BANDS", fmt::format("{}u", content.bands)},
                                  {"EMIT_AIR_TERMS", fmt::format("{}u", content.air_terms)},
                                  {"EMIT_AIR_TABLE", fmt::format("{}u", content.air_table)},
                                  {"EMIT_AIR_MODEL", fmt::format("{}u", content.air_model)},
                                  {"EMIT_TERMS", fmt::format("{}", content.terms)},
                                  {"EMIT_OUTPUTS", fmt::format("{}u", content.outputs)},
                                  rows_define(pass.rows_)};
  if (content.first_lobe != 0) {
    defines.push_back({"EMIT_LOBES", fmt::format("{}", content.first_lobe)});
  }
  if (content.air_sun != 0) {
    defines.push_back({"EMIT_AIR_SUN", fmt::format("{}u", content.air_sun)});
  }
  if (content.clutter) defines.push_back({"EMIT_CLUTTER", "1"});
  if (content.clutter_emissivity) defines.push_back({"EMIT_CLUTTER_EMISSIVITY", "1"});
  if (content.clouds) defines.push_back({"EMIT_CLOUDS", "1"});
  if (content.fog) defines.push_back({"EMIT_FOG", "1"});
  if (options.model == scene::ThermalModel::foster) {
    defines.push_back({"EMIT_FOSTER_GROUPS", fmt::format("{}", content.foster_groups)});
  }
  if (options.method == scene::ThermalMethod::cached) defines.push_back({"EMIT_CACHED", "1"});
  auto program = gl::Program::compute("passes/radiance.comp", defines);
  if (!program) return tl::unexpected(std::move(program.error()));
  pass.program_ = std::move(*program);
  return pass;
}

void RadiancePass::dispatch(const glm::uvec2& size_px) const noexcept {
  program_.use();
  dispatch_pixels(size_px, rows_);
}

}  // namespace emit::renderer
