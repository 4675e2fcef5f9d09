// SPDX-License-Identifier: Apache-2.0
#include "output/sample_row.hpp"

#include "emit/physics/check.hpp"
#include "output/wide.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace emit::server {
namespace {

/// Returns a pixel of a row, by itself.
inline float sample_pixel(const SampledRow& row, std::size_t i) noexcept {
  float x = row.x_px[i] - row.shift_px.x;
  float y = row.y_px[i] - row.shift_px.y;
  const auto x_end_px = static_cast<float>(row.last_column);
  const auto y_end_px = static_cast<float>(row.last_row);
  // A position that is not a number fails the comparisons.
  if (!(x >= -0.5F && x <= x_end_px + 0.5F && y >= -0.5F && y <= y_end_px + 0.5F)) {
    return row.outside;
  }
  x = x > 0.0F ? x : 0.0F;
  y = y > 0.0F ? y : 0.0F;
  x = x < x_end_px ? x : x_end_px;
  y = y < y_end_px ? y : y_end_px;
  const auto column = static_cast<std::int32_t>(x);
  const auto upper = static_cast<std::int32_t>(y);
  const float right_frac = x - static_cast<float>(column);
  const float down_frac = y - static_cast<float>(upper);
  const float* const sample = row.image + (upper * row.pitch_px + column);
  const std::int32_t right = column < row.last_column ? 1 : 0;
  const std::int32_t down = upper < row.last_row ? row.pitch_px : 0;
  // A fraction of 0 leaves the difference out, so that whole positions copy bits.
  const float above = sample[0] + right_frac * (sample[right] - sample[0]);
  const float below = sample[down] + right_frac * (sample[down + right] - sample[down]);
  return above + down_frac * (below - above);
}

}  // namespace

void sample_row_plain(const SampledRow& row, std::span<float> line) noexcept {
  for (std::size_t i = 0; i < line.size(); ++i) line[i] = sample_pixel(row, i);
}

#if defined(__x86_64__)

// The wide loop does what the plain one does, step by step. Products and sums are never fused, so
// that the bits are the same.

__attribute__((target("avx2"))) void sample_row_wide(const SampledRow& row,
                                                     std::span<float> line) noexcept {
  EMIT_DCHECK(has_wide());
  const __m256 shift_x = _mm256_set1_ps(row.shift_px.x);
  const __m256 shift_y = _mm256_set1_ps(row.shift_px.y);
  const __m256 zero = _mm256_setzero_ps();
  const __m256 begin = _mm256_set1_ps(-0.5F);
  const __m256 x_end = _mm256_set1_ps(static_cast<float>(row.last_column));
  const __m256 y_end = _mm256_set1_ps(static_cast<float>(row.last_row));
  const __m256 x_edge = _mm256_set1_ps(static_cast<float>(row.last_column) + 0.5F);
  const __m256 y_edge = _mm256_set1_ps(static_cast<float>(row.last_row) + 0.5F);
  const __m256 outside = _mm256_set1_ps(row.outside);
  const __m256i last_column = _mm256_set1_epi32(row.last_column);
  const __m256i last_row = _mm256_set1_epi32(row.last_row);
  const __m256i pitch = _mm256_set1_epi32(row.pitch_px);
  const __m256 all = _mm256_castsi256_ps(_mm256_set1_epi32(-1));
  const auto gather = [&](__m256i index) __attribute__((target("avx2"))) {
    return _mm256_mask_i32gather_ps(zero, row.image, index, all, 4);
  };
  std::size_t i = 0;
  for (; i + 8 <= line.size(); i += 8) {
    __m256 x = _mm256_sub_ps(_mm256_loadu_ps(row.x_px + i), shift_x);
    __m256 y = _mm256_sub_ps(_mm256_loadu_ps(row.y_px + i), shift_y);
    const __m256 inside = _mm256_and_ps(
        _mm256_and_ps(_mm256_cmp_ps(x, begin, _CMP_GE_OQ), _mm256_cmp_ps(x, x_edge, _CMP_LE_OQ)),
        _mm256_and_ps(_mm256_cmp_ps(y, begin, _CMP_GE_OQ), _mm256_cmp_ps(y, y_edge, _CMP_LE_OQ)));
    // The second operand is taken where the first one is not a number.
    x = _mm256_min_ps(_mm256_max_ps(x, zero), x_end);
    y = _mm256_min_ps(_mm256_max_ps(y, zero), y_end);
    const __m256i column = _mm256_cvttps_epi32(x);
    const __m256i upper = _mm256_cvttps_epi32(y);
    const __m256 right_frac = _mm256_sub_ps(x, _mm256_cvtepi32_ps(column));
    const __m256 down_frac = _mm256_sub_ps(y, _mm256_cvtepi32_ps(upper));
    const __m256i at = _mm256_add_epi32(_mm256_mullo_epi32(upper, pitch), column);
    // A comparison that holds gives -1.
    const __m256i right = _mm256_cmpgt_epi32(last_column, column);
    const __m256i down = _mm256_and_si256(_mm256_cmpgt_epi32(last_row, upper), pitch);
    const __m256i at_below = _mm256_add_epi32(at, down);
    const __m256 left_above = gather(at);
    const __m256 right_above = gather(_mm256_sub_epi32(at, right));
    const __m256 left_below = gather(at_below);
    const __m256 right_below = gather(_mm256_sub_epi32(at_below, right));
    const __m256 above = _mm256_add_ps(
        left_above, _mm256_mul_ps(right_frac, _mm256_sub_ps(right_above, left_above)));
    const __m256 below = _mm256_add_ps(
        left_below, _mm256_mul_ps(right_frac, _mm256_sub_ps(right_below, left_below)));
    const __m256 value =
        _mm256_add_ps(above, _mm256_mul_ps(down_frac, _mm256_sub_ps(below, above)));
    _mm256_storeu_ps(line.data() + i, _mm256_blendv_ps(outside, value, inside));
  }
  for (; i < line.size(); ++i) line[i] = sample_pixel(row, i);
}

#else

void sample_row_wide(const SampledRow& row, std::span<float> line) noexcept {
  sample_row_plain(row, line);
}

#endif

}  // namespace emit::server
