// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <vector>

namespace emit::renderer {

/// Model of the time that a frame takes: a constant, a share per triangle and a share per pixel,
/// fitted to frames that were timed. Thread: one at a time. Real time: add() and fit() are setup
/// only, frame_ms() is RT-safe.
class FrameCost {
 public:
  /// Adds a timed frame that drew `triangles` and rendered `pixels`.
  /// @pre All arguments are finite and not negative.
  void add(double triangles, double pixels, double frame_ms);
  /// Fits the model to the frames by least squares of the relative error. No share is negative.
  void fit();
  /// Expected time of a frame in ms; 0 before fit().
  [[nodiscard]] double frame_ms(double triangles, double pixels) const noexcept {
    return constant_ms_ + ms_per_triangle_ * triangles + ms_per_pixel_ * pixels;
  }

 private:
  std::vector<double> rows_;  ///< three numbers per frame, each divided by the time of the frame
  double constant_ms_ = 0.0;
  double ms_per_triangle_ = 0.0;
  double ms_per_pixel_ = 0.0;
};

}  // namespace emit::renderer
