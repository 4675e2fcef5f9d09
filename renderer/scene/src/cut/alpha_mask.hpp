// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <vector>

#include "image_frame.hpp"

namespace emit::scene {

/// Image of opacity by which `alphaMode` MASK keeps a surface: where the bilinear value is at least
/// the cutoff.
struct AlphaMask {
  ImageFrame frame;
  std::vector<float> alpha;  ///< row by row from v = 0, factor of the material included
  float cutoff = 0.5F;
  bool one_colour = false;  ///< the image has one colour: it shows nothing but the outline
  [[nodiscard]] float at(int x, int y) const {
    return alpha[static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width_px) +
                 static_cast<std::size_t>(x)];
  }
};

/// Bilinear opacity at a place in texels, the middle of the first texel being (0.5, 0.5).
[[nodiscard]] double alpha_at(const AlphaMask& mask, double x_px, double y_px);

}  // namespace emit::scene
