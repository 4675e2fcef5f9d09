// SPDX-License-Identifier: Apache-2.0
#include "stages/cloud_layer.hpp"

#include <algorithm>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float4.hpp>
#include <span>

#include "history/step_plan.hpp"

namespace emit::renderer {
namespace {

static_assert(physics::CloudField::kSide == EMIT_CLOUD_SIDE);
static_assert(physics::CloudField::kLevels == EMIT_CLOUD_LEVELS);

/// Height over which the change of the crossing with height is taken.
constexpr double kRiseM = 10.0;

}  // namespace

CloudLayer::CloudLayer(const physics::CloudField& field)
    : buffer_(gl::Buffer::dynamic(sizeof(gpu::CloudParams))),
      texture_(GL_R16, EMIT_CLOUD_SIDE, 2 * EMIT_CLOUD_SIDE) {
  // Rows of the smaller levels are not whole words.
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  for (std::size_t level = 0; level < physics::CloudField::kLevels; ++level) {
    const auto side = static_cast<GLsizei>(EMIT_CLOUD_SIDE >> level);
    const auto row = static_cast<GLint>(2 * EMIT_CLOUD_SIDE - (2 * EMIT_CLOUD_SIDE >> level));
    glTextureSubImage2D(texture_.id(), 0, 0, row, side, side, GL_RED, GL_UNSIGNED_SHORT,
                        field.level(level).data());
  }
  constexpr GLint kUsualAlignment = 4;
  glPixelStorei(GL_UNPACK_ALIGNMENT, kUsualAlignment);
}

void CloudLayer::update(const physics::CloudField& field, const physics::CloudLight& light,
                        const physics::SunPosition& sun, const glm::dvec3& camera_world_m,
                        std::int64_t sim_time_ns) noexcept {
  const glm::dvec2 east = field.tiles_of({1.0, 0.0});
  const glm::dvec2 north = field.tiles_of({0.0, 1.0});
  const glm::dvec2 below_m(camera_world_m);
  const double base_m = field.clouds().base_m;
  params_.tiles_per_m = glm::vec4(glm::vec2(east), glm::vec2(north));
  params_.camera_tile = glm::vec2(field.tile_at(below_m, sim_time_ns));
  params_.camera_m = static_cast<float>(camera_world_m.z);
  params_.above_m = static_cast<float>(base_m - camera_world_m.z);
  params_.gain = static_cast<float>(light.gain);
  params_.depth = static_cast<float>(light.depth);
  params_.texels_per_m = static_cast<float>(EMIT_CLOUD_SIDE / field.clouds().period_m());
  if (!(sun.elevation.value() > StepPlan::kMinSunElevationRad)) return;
  const glm::dvec2 crossing_m = physics::cloud_crossing_m(base_m, sun.direction_enu);
  const glm::dvec2 higher_m =
      physics::cloud_crossing_m(std::max(base_m - kRiseM, 1.0), sun.direction_enu);
  params_.sun_tile = glm::vec2(field.tile_at(below_m + crossing_m, sim_time_ns));
  params_.sun_tiles_per_m_up =
      glm::vec2(field.tiles_of(higher_m - crossing_m) / std::min(kRiseM, base_m - 1.0));
}

void CloudLayer::upload() const noexcept {
  buffer_.upload(std::span<const gpu::CloudParams>(&params_, 1));
}

void CloudLayer::bind() const noexcept {
  buffer_.bind_uniform(EMIT_BIND_CLOUDS);
  texture_.bind(EMIT_TEX_CLOUDS);
}

}  // namespace emit::renderer
