// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/check.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <stdexcept>
#include <string>

namespace emit::physics {
namespace {

[[noreturn]] void throw_message(const char* message) {
  throw std::logic_error(message);
}

class Check : public ::testing::Test {
 protected:
  void SetUp() override { before_ = set_panic_handler(&throw_message); }
  void TearDown() override { set_panic_handler(before_); }

  template <class Body>
  static std::string message_of(const Body& body) {
    try {
      body();
    } catch (const std::logic_error& error) {
      return error.what();
    }
    return {};
  }

 private:
  PanicHandler before_ = nullptr;
};

TEST_F(Check, PassesWhatHolds) {
  const std::size_t index = 2;
  EXPECT_EQ(message_of([&] {
              EMIT_CHECK(index == 2);
              EMIT_CHECK_OP(index, <, 3U);
            }),
            "");
}

TEST_F(Check, NamesPlaceAndCondition) {
  const bool ready = false;
  const std::string message = message_of([&] { EMIT_CHECK(ready); });
  EXPECT_NE(message.find("check_test.cpp:"), std::string::npos) << message;
  EXPECT_NE(message.find("check failed: ready"), std::string::npos) << message;
}

TEST_F(Check, ShowsBothOperandsAsNumbers) {
  const std::size_t index = 7;
  const unsigned char count = 3;
  const std::string message = message_of([&] { EMIT_CHECK_OP(index, <, count); });
  EXPECT_NE(message.find("index < count (7 < 3)"), std::string::npos) << message;
}

TEST_F(Check, AbortsWhenTheHandlerReturns) {
  set_panic_handler(nullptr);
  const bool ready = false;
  EXPECT_DEATH(EMIT_CHECK(ready), "check failed: ready");
}

}  // namespace
}  // namespace emit::physics
