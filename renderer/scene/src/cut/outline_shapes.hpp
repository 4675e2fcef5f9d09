// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <vector>

#include "alpha_mask.hpp"
#include "geos.hpp"
#include "region_image.hpp"

namespace emit::scene {

/// Polygons of one image, in texels.
struct OutlineShapes {
  struct Part {
    const GEOSGeometry* polygon = nullptr;  ///< part of `owner`
    std::uint8_t part = 0;
  };
  Geos::Shape owner{nullptr, Geos::Free{nullptr}};  ///< null: the outlines could not be made
  std::vector<Part> parts;
};

/// Returns what a mask keeps, as part 0, with outlines that are off by at most `tolerance_px`.
[[nodiscard]] OutlineShapes outline_shapes(const Geos& geos, const AlphaMask& mask,
                                           double tolerance_px);
/// Returns the regions of an image, without gaps and without overlap.
[[nodiscard]] OutlineShapes outline_shapes(const Geos& geos, const RegionImage& image,
                                           double tolerance_px);

}  // namespace emit::scene
