// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <vector>

namespace emit::renderer {

/// What a frame takes, from what it draws: a constant, a share per triangle and one per pixel,
/// fitted to frames that were timed. Setup but for frame_ms(), which is RT-safe.
class FrameCost {
 public:
  void add(double triangles, double pixels, double frame_ms);
  /// Least squares of the relative error, no share negative.
  void fit();
  /// 0 before fit().
  [[nodiscard]] double frame_ms(double triangles, double pixels) const noexcept {
    return constant_ms_ + ms_per_triangle_ * triangles + ms_per_pixel_ * pixels;
  }

 private:
  std::vector<double> rows_;  ///< of three, divided by the time
  double constant_ms_ = 0.0;
  double ms_per_triangle_ = 0.0;
  double ms_per_pixel_ = 0.0;
};

}  // namespace emit::renderer
