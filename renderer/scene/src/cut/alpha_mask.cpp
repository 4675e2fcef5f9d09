// SPDX-License-Identifier: Apache-2.0
#include "alpha_mask.hpp"

#include <cmath>

namespace emit::scene {

double alpha_at(const AlphaMask& mask, double x_px, double y_px) {
  x_px = near_first(x_px, mask.frame.width_px, mask.frame.wrap_u);
  y_px = near_first(y_px, mask.frame.height_px, mask.frame.wrap_v);
  const double left = std::floor(x_px - 0.5);
  const double top = std::floor(y_px - 0.5);
  const double right_share = x_px - 0.5 - left;
  const double lower_share = y_px - 0.5 - top;
  const auto value = [&](int dx, int dy) {
    return static_cast<double>(
        mask.at(wrapped(static_cast<int>(left) + dx, mask.frame.width_px, mask.frame.wrap_u),
                wrapped(static_cast<int>(top) + dy, mask.frame.height_px, mask.frame.wrap_v)));
  };
  return std::lerp(std::lerp(value(0, 0), value(1, 0), right_share),
                   std::lerp(value(0, 1), value(1, 1), right_share), lower_share);
}

}  // namespace emit::scene
