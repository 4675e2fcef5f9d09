// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_float2.hpp>
#include <span>

/// The inner loop of resampling: one pixel at a time, and eight with AVX2. Both give the same bits.
/// RT-safe.
namespace emit::server {

/// Positions of one row of a frame, and the image that they point into.
struct SampledRow {
  const float* x_px = nullptr;  ///< from the centre of the image's first pixel
  const float* y_px = nullptr;
  glm::vec2 shift_px{0.0F};  ///< subtracted from the positions
  const float* image = nullptr;
  std::int32_t pitch_px = 0;  ///< pixels from row to row of the image
  std::int32_t last_column = 0;
  std::int32_t last_row = 0;
  float outside = 0.0F;  ///< value beyond half a pixel around the image, and for NaN
};

/// Writes the bilinear values of a row.
void sample_row_plain(const SampledRow& row, std::span<float> line) noexcept;
/// The same, with AVX2. @pre has_wide()
void sample_row_wide(const SampledRow& row, std::span<float> line) noexcept;

}  // namespace emit::server
