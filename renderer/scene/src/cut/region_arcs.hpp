// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double2.hpp>
#include <vector>

#include "region_image.hpp"

namespace emit::scene {

/// Outside of the image.
inline constexpr std::uint8_t kNoRegion = 255;
/// Blocks of the image end at multiples of this many texels.
inline constexpr int kArcBlockPx = 64;

/// Line along the sides of texels between two regions, in texels. It ends where three or more
/// lines meet, or where it began.
struct RegionArc {
  std::vector<glm::dvec2> points;  ///< its corners
  std::uint8_t left = kNoRegion;   ///< region at (-d.y, d.x) of its direction d
  std::uint8_t right = kNoRegion;
};

/// Lines that part the regions of one image from each other and the image from what is outside.
/// Blocks with many outlines are closed along their sides, so that no region has many thousands of
/// holes.
///
/// An image that repeats ends at 0 and at its width; a clamped one goes on for ten thousand texels.
[[nodiscard]] std::vector<RegionArc> region_arcs(const RegionImage& image);

}  // namespace emit::scene
