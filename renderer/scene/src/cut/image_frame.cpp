// SPDX-License-Identifier: Apache-2.0
#include "image_frame.hpp"

#include <algorithm>
#include <cmath>

namespace emit::scene {

double near_first(double px, int size, Wrap wrap) {
  const double period = wrap == Wrap::mirror ? 2.0 * size : static_cast<double>(size);
  if (wrap == Wrap::clamp) return std::clamp(px, 0.0, period);
  return px - std::floor(px / period) * period;
}

int wrapped(int i, int size, Wrap wrap) {
  if (wrap == Wrap::clamp) return std::clamp(i, 0, size - 1);
  const int period = wrap == Wrap::mirror ? 2 * size : size;
  i = ((i % period) + period) % period;
  return i < size ? i : period - 1 - i;
}

}  // namespace emit::scene
