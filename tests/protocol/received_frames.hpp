// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <gtest/gtest.h>

#include <cstring>

#include "emit/protocol/reassembler.hpp"
#include "protocol/frames.hpp"

/// Expectations about received frames.
namespace emit::test {

/// Expects that every valid pixel is the sent one, every other pixel is 0, and the counters agree.
inline void expect_true_to(const protocol::ReceivedFrame& received, const Frame& sent) {
  ASSERT_EQ(received.pixels.size() * 4, sent.pixels.size());
  std::uint64_t missing = 0;
  for (std::size_t i = 0; i < received.pixels.size(); ++i) {
    float expected = 0.0F;
    if (received.validity.pixel(i)) {
      std::memcpy(&expected, &sent.pixels[i * 4], sizeof expected);
    } else {
      ++missing;
    }
    ASSERT_EQ(received.pixels[i], expected) << i;
  }
  EXPECT_EQ(received.missing_px, missing);
  EXPECT_EQ(received.complete, missing == 0);
  EXPECT_EQ((received.header.flags & protocol::kFlagPartial) != 0, missing != 0);
}

}  // namespace emit::test
