// SPDX-License-Identifier: Apache-2.0
#include "stages/clutter_fields.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "emit/physics/check.hpp"
#include "emit/physics/surface/power_law_field.hpp"

namespace emit::renderer {
namespace {

/// True when two materials vary by the same field, whatever it changes of each.
bool same_field(const scene::Clutter& a, const scene::Clutter& b) noexcept {
  return a.shortest_m == b.shortest_m && a.longest_m == b.longest_m && a.slope == b.slope &&
         a.seed == b.seed;
}

static_assert(scene::Clutter::kSide == EMIT_CLUTTER_SIDE);
constexpr std::size_t kSide = EMIT_CLUTTER_SIDE;
constexpr std::size_t kLevels = EMIT_CLUTTER_LEVELS;
constexpr std::size_t kHead = ClutterFields::kMost * kLevels;
/// A level begins at a multiple of as many texels.
constexpr std::size_t kAlign = 4;

/// Value within the field's bounds, as the upper half of a float32, rounded to the nearest.
std::uint32_t short_float(float sd) noexcept {
  constexpr auto kMost = static_cast<float>(scene::Clutter::kMostSd);
  return (std::bit_cast<std::uint32_t>(std::clamp(sd, -kMost, kMost)) + 0x8000U) >> 16U;
}

/// Appends the levels of a field as passes/clutter.glsl reads them.
void append(std::span<const physics::FieldLevel> levels, std::size_t field,
            std::vector<std::uint32_t>& out) {
  EMIT_CHECK_OP(levels.size(), ==, kLevels);
  for (std::size_t l = 0; l < levels.size(); ++l) {
    const physics::FieldLevel& level = levels[l];
    const auto lost =
        static_cast<std::uint32_t>(std::lround(255.0 * std::clamp(1.0 - level.variance, 0.0, 1.0)));
    out.resize((out.size() + kAlign - 1) / kAlign * kAlign);
    out[field * kLevels + l] = static_cast<std::uint32_t>(out.size() / kAlign) << 8U | lost;
    for (std::size_t y = 0; y <= level.side; ++y) {
      const float* row = &level.values[y % level.side * level.side];
      for (std::size_t x = 0; x < level.side; ++x) {
        out.push_back(short_float(row[x]) << 16U | short_float(row[(x + 1) % level.side]));
      }
    }
  }
}

}  // namespace

physics::Result<ClutterFields> ClutterFields::build(std::span<const scene::Material> materials) {
  ClutterFields out;
  std::vector<const scene::Clutter*> fields;
  for (const scene::Material& material : materials) {
    DrawnClutter& drawn = out.drawn_.emplace_back();
    if (!material.clutter) continue;
    // Materials of one field share it.
    const auto known = std::ranges::find_if(fields, [&material](const scene::Clutter* field) {
      return same_field(*field, *material.clutter);
    });
    drawn.field = static_cast<std::uint32_t>(known - fields.begin()) + 1;
    if (known == fields.end()) fields.push_back(&*material.clutter);
    drawn.tiles_per_m = 1.0 / material.clutter->period_m();
    drawn.heat = scene::varies_in_heat(material);
    out.emissivity_ = out.emissivity_ || material.clutter->emissivity_sd_frac != 0.0 ||
                      !material.clutter->band_emissivity_sd_frac.empty();
  }
  if (fields.empty()) return out;
  if (fields.size() > kMost) {
    return physics::make_error(physics::ErrorCode::config,
                               fmt::format("[[clutter]]: the materials of the scene vary by {} "
                                           "different fields: {} are possible",
                                           fields.size(), kMost));
  }
  std::vector<std::uint32_t> texels(kHead);
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const scene::Clutter& clutter = *fields[i];
    append(physics::power_law_field({.period_m = clutter.period_m(),
                                     .shortest_m = clutter.shortest_m,
                                     .longest_m = clutter.longest_m,
                                     .slope = clutter.slope,
                                     .seed = clutter.seed},
                                    kSide),
           i, texels);
  }
  // OpenGL promises no more than 65536 texels.
  GLint most_texels = 0;
  glGetIntegerv(GL_MAX_TEXTURE_BUFFER_SIZE, &most_texels);
  if (texels.size() > static_cast<std::size_t>(std::max(most_texels, 0))) {
    return physics::make_error(physics::ErrorCode::gpu,
                               fmt::format("[[clutter]]: the fields have {} texels: the device "
                                           "takes {} in a buffer texture",
                                           texels.size(), most_texels));
  }
  out.buffer_ = gl::Buffer::from(std::span<const std::uint32_t>(texels));
  out.texture_ = gl::BufferTexture(GL_R32UI, out.buffer_);
  return out;
}

}  // namespace emit::renderer
