// SPDX-License-Identifier: Apache-2.0
#include "foliage_image.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/ext/vector_double2.hpp>
#include <glm/geometric.hpp>
#include <string>

#include "emit/physics/constants.hpp"
#include "random.hpp"

// The library's own code is not held to the warnings of this project.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpragmas"
#pragma GCC diagnostic ignored "-Wold-style-cast"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wcast-qual"
#define STB_IMAGE_WRITE_STATIC
#define STB_IMAGE_WRITE_IMPLEMENTATION
#include <stb_image_write.h>
#pragma GCC diagnostic pop

namespace emit::scenegen {
namespace {

/// A coarse image keeps the outline to some seventy corners.
constexpr int kSidePx = 24;

struct Disc {
  glm::dvec2 middle;
  double radius = 0.0;
};

}  // namespace

std::vector<std::byte> foliage_png() {
  // Clumps of leaves stand around the middle of the crown; a few gaps show the sky.
  Random random(7);
  std::vector<Disc> clumps = {{{0.5, 0.52}, 0.27}};
  for (int i = 0; i < 11; ++i) {
    const double angle = 2.0 * physics::kPi * (i + random.between(-0.3, 0.3)) / 11.0;
    const double out = random.between(0.26, 0.33);
    clumps.push_back({{0.5 + out * std::cos(angle), 0.51 + 1.05 * out * std::sin(angle)},
                      random.between(0.09, 0.15)});
  }
  std::vector<Disc> gaps;
  for (int i = 0; i < 6; ++i) {
    const double angle = random.between(0.0, 2.0 * physics::kPi);
    const double out = random.between(0.15, 0.32);
    gaps.push_back(
        {{0.5 + out * std::cos(angle), 0.5 + out * std::sin(angle)}, random.between(0.02, 0.045)});
  }
  std::string rgba;
  for (int y = 0; y < kSidePx; ++y) {
    for (int x = 0; x < kSidePx; ++x) {
      const glm::dvec2 at((x + 0.5) / kSidePx, (y + 0.5) / kSidePx);
      double within = -1.0;
      for (const Disc& clump : clumps) {
        within = std::max(within, clump.radius - glm::distance(at, clump.middle));
      }
      for (const Disc& gap : gaps) {
        within = std::min(within, glm::distance(at, gap.middle) - gap.radius);
      }
      // The opacity rises over two texels around the outline.
      const double opacity = std::clamp(0.5 + 0.5 * kSidePx * within, 0.0, 1.0);
      rgba += std::string("\x30\x58\x28", 3);
      rgba += static_cast<char>(static_cast<std::uint8_t>(std::lround(255.0 * opacity)));
    }
  }
  std::vector<std::byte> out;
  stbi_write_png_to_func(
      [](void* file, void* data, int size) {
        const auto* bytes = static_cast<const std::byte*>(data);
        auto& into = *static_cast<std::vector<std::byte>*>(file);
        into.insert(into.end(), bytes, bytes + size);
      },
      &out, kSidePx, kSidePx, 4, rgba.data(), 4 * kSidePx);
  return out;
}

}  // namespace emit::scenegen
