// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "image_frame.hpp"

namespace emit::scene {

/// Colour of an image: red, green and blue of sRGB.
using Rgb = std::array<std::uint8_t, 3>;

/// Most colours that a legend may have.
inline constexpr std::size_t kMaxRegions = 64;
/// Texels farther than this from every colour of the legend are unlike all of them (OKLab; black
/// and white are 1 apart).
inline constexpr double kUnlikeDistance = 0.1;

/// Image that says which of several regions every place of a surface belongs to.
struct RegionImage {
  ImageFrame frame;
  std::size_t regions = 0;           ///< number of regions, at most kMaxRegions
  std::vector<std::uint8_t> region;  ///< of each texel, row by row from v = 0
  std::vector<std::uint8_t> unlike;  ///< 1 where the colour is unlike all of the legend
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width_px) +
           static_cast<std::size_t>(x);
  }
  [[nodiscard]] std::uint8_t at(int x, int y) const { return region[index(x, y)]; }
};

/// Texel at a place of an image, in texels from its corner. The image goes on beyond its edges.
struct TexelPlace {
  int x = 0;
  int y = 0;
};
[[nodiscard]] TexelPlace texel_at(const ImageFrame& frame, double x_px, double y_px);

/// Gives each texel the region whose colour is the nearest in OKLab (B. Ottosson, 2020). A texel
/// whose colour is none of the legend takes the nearest among the regions of the exact ones around
/// it, so that the mixed texels along an outline do not become a third region.
///
/// @param pixels  red, green, blue and opacity of each texel, row by row: 4 * width * height bytes
/// @param legend  colours of the regions, 1 to kMaxRegions of them
[[nodiscard]] RegionImage regions_by_colour(const ImageFrame& frame,
                                            std::span<const unsigned char> pixels,
                                            std::span<const Rgb> legend);

/// A colour of an image and the share of its texels that it stands for.
struct ColourShare {
  Rgb rgb{};
  double frac = 0.0;
};
/// The colours of an image that has at most kMaxRegions of them, or else the means of similar ones;
/// the most frequent first, at most `most`.
/// @param pixels  red, green, blue and opacity of each texel; clear ones do not count
[[nodiscard]] std::vector<ColourShare> main_colours(std::span<const unsigned char> pixels,
                                                    std::size_t most);

/// Patches of fewer texels than `smallest_px` take the region that most of their border has.
/// Patches are joined along the sides of texels; the image counts as it is, without repeating.
void drop_small_patches(RegionImage& image, std::uint32_t smallest_px);

}  // namespace emit::scene
