// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/check.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <string>

#include "support/failed_check.hpp"

namespace emit::physics {
namespace {

using test::failed_check;

TEST(Check, PassesWhatHolds) {
  const std::size_t index = 2;
  EXPECT_EQ(failed_check([&] {
              EMIT_CHECK(index == 2);
              EMIT_CHECK_OP(index, <, 3U);
            }),
            "");
}

TEST(Check, NamesPlaceAndCondition) {
  const bool ready = false;
  const std::string message = failed_check([&] { EMIT_CHECK(ready); });
  EXPECT_NE(message.find("check_test.cpp:"), std::string::npos) << message;
  EXPECT_NE(message.find("check failed: ready"), std::string::npos) << message;
}

TEST(Check, ShowsBothOperandsAsNumbers) {
  const std::size_t index = 7;
  const unsigned char count = 3;
  const std::string message = failed_check([&] { EMIT_CHECK_OP(index, <, count); });
  EXPECT_NE(message.find("index < count (7 < 3)"), std::string::npos) << message;
}

TEST(Check, AbortsWhenTheHandlerReturns) {
  const bool ready = false;
  EXPECT_DEATH(EMIT_CHECK(ready), "check failed: ready");
}

}  // namespace
}  // namespace emit::physics
