// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/units.hpp"

#include <gtest/gtest.h>

#include <type_traits>

namespace emit::physics {
namespace {

TEST(Units, LiteralsCarryTheirUnit) {
  EXPECT_DOUBLE_EQ((300_K).value(), 300.0);
  EXPECT_DOUBLE_EQ((1.5_m).value(), 1.5);
  EXPECT_DOUBLE_EQ((4.2_um).value(), 4.2);
  EXPECT_DOUBLE_EQ((180_deg).value(), kPi);
  EXPECT_DOUBLE_EQ(to_degrees(0.5_rad), 90.0 / kPi);
}

TEST(Units, OneKindAddsScalesAndCompares) {
  EXPECT_EQ(300_K + 1.5_K, 301.5_K);
  EXPECT_EQ(2.0 * 3_m, 6_m);
  EXPECT_LT(2_um, 3_um);
  EXPECT_DOUBLE_EQ(6_m / 4_m, 1.5);
  Kelvin t = 10_K;
  t -= 4_K;
  EXPECT_EQ(-t, Kelvin(-6.0));
}

TEST(Units, NothingConvertsByItself) {
  static_assert(!std::is_convertible_v<double, Kelvin>);
  static_assert(!std::is_convertible_v<Kelvin, double>);
  static_assert(!std::is_convertible_v<Metres, Micrometres>);
  static_assert(sizeof(Kelvin) == sizeof(double));
}

}  // namespace
}  // namespace emit::physics
