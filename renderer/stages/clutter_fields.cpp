// SPDX-License-Identifier: Apache-2.0
#include "stages/clutter_fields.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/packing.hpp>

#include "emit/physics/surface/power_law_field.hpp"

namespace emit::renderer {
namespace {

static_assert(scene::Clutter::kSide == EMIT_CLUTTER_SIDE);
constexpr std::size_t kSide = EMIT_CLUTTER_SIDE;
constexpr std::size_t kRows = kSide + kSide / 2;

struct Texel {
  std::uint32_t upper = 0;  ///< the texel and its neighbour in the row
  std::uint32_t lower = 0;  ///< the same of the next row
};

/// Places the levels of a field: the finest one, and below it the others side by side. In the last
/// column below, row l has the variance that level l keeps.
void place(std::span<const physics::FieldLevel> levels, std::span<Texel> out) {
  for (std::size_t l = 0; l < levels.size(); ++l) {
    const physics::FieldLevel& level = levels[l];
    const std::size_t first_x = l == 0 ? 0 : kSide - 2 * level.side;
    const std::size_t first_y = l == 0 ? 0 : kSide;
    const auto value = [&](std::size_t x, std::size_t y) {
      constexpr auto kMost = static_cast<float>(scene::Clutter::kMostSd);
      const float sd = level.values[(y % level.side) * level.side + x % level.side];
      return std::clamp(sd / kMost, -1.0F, 1.0F);
    };
    for (std::size_t y = 0; y < level.side; ++y) {
      for (std::size_t x = 0; x < level.side; ++x) {
        out[(first_y + y) * kSide + first_x + x] = {
            glm::packSnorm2x16(glm::vec2(value(x, y), value(x + 1, y))),
            glm::packSnorm2x16(glm::vec2(value(x, y + 1), value(x + 1, y + 1)))};
      }
    }
    out[(kSide + l) * kSide + kSide - 1].upper =
        std::bit_cast<std::uint32_t>(static_cast<float>(level.variance));
  }
}

}  // namespace

physics::Result<ClutterFields> ClutterFields::build(std::span<const scene::Material> materials) {
  ClutterFields out;
  std::vector<const scene::Clutter*> fields;
  for (const scene::Material& material : materials) {
    DrawnClutter& drawn = out.drawn_.emplace_back();
    if (!material.clutter) continue;
    fields.push_back(&*material.clutter);
    drawn.field = static_cast<std::uint32_t>(fields.size());
    drawn.tiles_per_m = 1.0 / material.clutter->period_m();
    drawn.heat = scene::varies_in_heat(material);
  }
  if (fields.empty()) return out;
  if (fields.size() > kMost) {
    return physics::make_error(physics::ErrorCode::config,
                               fmt::format("[[clutter]]: {} materials of the scene vary: {} are "
                                           "possible",
                                           fields.size(), kMost));
  }
  out.texture_ = gl::Texture(GL_RG32UI, static_cast<GLsizei>(kSide),
                             static_cast<GLsizei>(kRows * fields.size()));
  std::vector<Texel> texels(kSide * kRows);
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
                        static_cast<GLsizei>(kSide), static_cast<GLsizei>(kRows), GL_RG_INTEGER,
                        GL_UNSIGNED_INT, texels.data());
  }
  return out;
}

}  // namespace emit::renderer
