// SPDX-License-Identifier: Apache-2.0
#include "output/sample_row.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "output/wide.hpp"

namespace emit::server {
namespace {

/// A journal of one machine replays on another: the loops may not differ by a bit.
TEST(SampleRow, EightPixelsAtATimeGiveTheBitsOfOne) {
  if (!has_wide()) GTEST_SKIP() << "no AVX2";
  std::mt19937 random(3);
  std::uniform_real_distribution<float> any(0.0F, 1.0F);
  for (const auto& [columns, rows] : {std::pair{1, 1}, {1, 7}, {9, 1}, {37, 21}}) {
    const std::int32_t pitch = columns + 5;
    std::vector<float> image(static_cast<std::size_t>(pitch * rows));
    for (float& value : image) value = 100.0F * any(random);
    for (std::size_t length : {1U, 7U, 8U, 29U, 640U}) {
      std::vector<float> x(length);
      std::vector<float> y(length);
      for (std::size_t i = 0; i < length; ++i) {
        x[i] = (static_cast<float>(columns) + 3.0F) * any(random) - 2.0F;
        y[i] = (static_cast<float>(rows) + 3.0F) * any(random) - 2.0F;
        if (i % 11 == 3) x[i] = std::floor(x[i]);  // whole places, and the very edges
        if (i % 13 == 5) y[i] = static_cast<float>(rows) - 0.5F;
        if (i % 17 == 7) x[i] = -0.5F;
        if (i % 19 == 2) y[i] = std::numeric_limits<float>::quiet_NaN();
      }
      const SampledRow row{x.data(), y.data(),    {0.25F, -0.125F}, image.data(),
                           pitch,    columns - 1, rows - 1,         3.5F};
      std::vector<float> plain(length);
      std::vector<float> wide(length);
      sample_row_plain(row, plain);
      sample_row_wide(row, wide);
      ASSERT_EQ(std::memcmp(plain.data(), wide.data(), length * sizeof(float)), 0)
          << columns << " x " << rows << ", " << length;
    }
  }
}

}  // namespace
}  // namespace emit::server
