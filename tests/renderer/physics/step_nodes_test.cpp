// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/step_nodes.hpp"
#include "support/times.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace emit::physics {
namespace {

using emit::test::kSecondNs;
constexpr std::int64_t kWindow = 12600 * kSecondNs;  // 3.5 h

TEST(StepNodes, RatiosOfTheThreeAndAHalfHourWindow) {
  EXPECT_NEAR(geometric_step_ratio(12600.0, 20.0, 27), 1.196, 5e-4);
  EXPECT_NEAR(geometric_step_ratio(12600.0, 20.0, 13), 1.573, 5e-4);
  EXPECT_EQ(geometric_step_ratio(100.0, 20.0, 27), 1.0);
  EXPECT_EQ(geometric_step_ratio(540.0, 20.0, 27), 1.0);
}

TEST(StepNodes, GeometricIntervalsGrowByOneRatioIntoThePast) {
  for (const std::size_t steps : {2U, 9U, 27U, 90U}) {
    std::vector<std::int64_t> nodes(steps + 1);
    geometric_step_nodes(-kWindow, 0, 20.0, nodes);
    EXPECT_EQ(nodes.front(), -kWindow);
    EXPECT_EQ(nodes.back(), 0);
    EXPECT_NEAR(static_cast<double>(nodes[steps] - nodes[steps - 1]), 20e9, 1.0);
    const double ratio = geometric_step_ratio(12600.0, 20.0, static_cast<std::uint32_t>(steps));
    for (std::size_t i = 1; i < steps; ++i) {
      const auto newer = static_cast<double>(nodes[i + 1] - nodes[i]);
      const auto older = static_cast<double>(nodes[i] - nodes[i - 1]);
      EXPECT_NEAR(older / newer, ratio, 1e-6) << steps << ' ' << i;
    }
  }
}

TEST(StepNodes, AWindowShorterThanItsFirstStepsIsDividedEvenly) {
  std::vector<std::int64_t> geometric(28);
  std::vector<std::int64_t> uniform(28);
  geometric_step_nodes(0, 500 * kSecondNs, 20.0, geometric);
  uniform_step_nodes(0, 500 * kSecondNs, uniform);
  EXPECT_EQ(geometric, uniform);
}

TEST(StepNodes, UniformIntervalsDifferByOneNanosecondAtMost) {
  std::vector<std::int64_t> nodes(91);
  uniform_step_nodes(17, 17 + kWindow + 1, nodes);
  EXPECT_EQ(nodes.front(), 17);
  EXPECT_EQ(nodes.back(), 17 + kWindow + 1);
  for (std::size_t i = 1; i < nodes.size(); ++i) {
    EXPECT_NEAR(static_cast<double>(nodes[i] - nodes[i - 1]), 140e9, 1.0);
  }
}

TEST(StepNodes, NoHistoryYetPutsEveryNodeAtNow) {
  for (const std::int64_t start : {5 * kSecondNs, 9 * kSecondNs}) {
    std::vector<std::int64_t> nodes(14, -1);
    geometric_step_nodes(start, 5 * kSecondNs, 20.0, nodes);
    EXPECT_EQ(std::count(nodes.begin(), nodes.end(), 5 * kSecondNs), 14);
  }
}

TEST(StepNodes, TinyWindowsAndSingleStepsStayOrdered) {
  for (const std::int64_t window :
       {1L, 2L, 1000L, 539999999999L, 540000000001L, 31536000000000000L}) {
    for (const std::size_t count : {2U, 3U, 28U}) {
      std::vector<std::int64_t> nodes(count);
      geometric_step_nodes(0, window, 20.0, nodes);
      EXPECT_EQ(nodes.front(), 0);
      EXPECT_EQ(nodes.back(), window);
      EXPECT_TRUE(std::is_sorted(nodes.begin(), nodes.end())) << window << ' ' << count;
    }
  }
}

}  // namespace
}  // namespace emit::physics
