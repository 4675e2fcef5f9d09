// SPDX-License-Identifier: Apache-2.0
#include "stages/clutter_fields.hpp"

#include <fmt/format.h>

#include <algorithm>
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
constexpr std::size_t kColumns = kSide + kSide / 4 * 3;
constexpr std::size_t kRows = 2 * kSide;

struct Texel {
  std::uint32_t upper = 0;  ///< the texel and its neighbour in the row
  std::uint32_t lower = 0;  ///< the same of the next row
};

/// Value in steps of 14 bits.
std::uint32_t steps_of(float sd) noexcept {
  constexpr double kMiddle = 8191.5;
  const double steps = kMiddle * (1.0 + static_cast<double>(sd) / scene::Clutter::kMostSd);
  return static_cast<std::uint32_t>(std::lround(std::clamp(steps, 0.0, 2.0 * kMiddle)));
}

/// Places the levels of a field as passes/clutter.glsl reads them.
void place(std::span<const physics::FieldLevel> levels, std::span<Texel> out) {
  EMIT_CHECK_OP(levels.size(), ==, std::size_t{EMIT_CLUTTER_LEVELS});
  for (std::size_t l = 0; l < levels.size(); ++l) {
    const physics::FieldLevel& level = levels[l];
    const std::size_t pair = l / 2;
    const std::size_t first_x = l % 2 == 0 ? 0 : kSide >> pair;
    const std::size_t first_y = 2 * kSide - (2 * kSide >> pair);
    const auto lost =
        static_cast<std::uint32_t>(std::lround(255.0 * std::clamp(1.0 - level.variance, 0.0, 1.0)));
    const auto steps = [&](std::size_t x, std::size_t y) {
      return steps_of(level.values[(y % level.side) * level.side + x % level.side]);
    };
    for (std::size_t y = 0; y < level.side; ++y) {
      for (std::size_t x = 0; x < level.side; ++x) {
        const auto row = [&](std::size_t v) { return steps(x, v) | steps(x + 1, v) << 14U; };
        out[(first_y + y) * kColumns + first_x + x] = {row(y) | (lost & 15U) << 28U,
                                                       row(y + 1) | lost >> 4U << 28U};
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
  out.texture_ = gl::Texture(GL_RG32UI, static_cast<GLsizei>(kColumns),
                             static_cast<GLsizei>(kRows * fields.size()));
  std::vector<Texel> texels(kColumns * kRows);
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const scene::Clutter& clutter = *fields[i];
    place(physics::power_law_field({.period_m = clutter.period_m(),
                                    .shortest_m = clutter.shortest_m,
                                    .longest_m = clutter.longest_m,
                                    .slope = clutter.slope,
                                    .seed = clutter.seed},
                                   kSide),
          texels);
    glTextureSubImage2D(out.texture_.id(), 0, 0, static_cast<GLint>(i * kRows),
                        static_cast<GLsizei>(kColumns), static_cast<GLsizei>(kRows), GL_RG_INTEGER,
                        GL_UNSIGNED_INT, texels.data());
  }
  return out;
}

}  // namespace emit::renderer
