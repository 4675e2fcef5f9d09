// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/stream_report.hpp"

#include <gtest/gtest.h>

namespace emit::tool {
namespace {

client::ReceivedFrame frame(std::uint64_t number, std::uint32_t flags = 0,
                            std::uint32_t lost_before = 0, std::uint64_t run = 1) {
  client::ReceivedFrame out;
  out.header.run_id = run;
  out.header.frame_number = number;
  out.header.flags = flags;
  out.frames_lost_before = lost_before;
  return out;
}

std::uint64_t unflagged_after(const client::ReceivedFrame& second, std::uint32_t every_nth = 1) {
  StreamReport report(every_nth);
  report.add(frame(1));
  report.add(second);
  return report.unflagged_gaps();
}

TEST(StreamReport, AGapIsFlaggedByTheDaemonsSkipOrByAsManyLosses) {
  EXPECT_EQ(unflagged_after(frame(2)), 0U);
  EXPECT_EQ(unflagged_after(frame(4)), 1U);
  EXPECT_EQ(unflagged_after(frame(4, protocol::kFlagGapBefore)), 0U);
  EXPECT_EQ(unflagged_after(frame(4, protocol::kFlagLostBefore, 2)), 0U);
  EXPECT_EQ(unflagged_after(frame(4, protocol::kFlagLostBefore, 1)), 1U)
      << "one loss excuses one frame";
  EXPECT_EQ(unflagged_after(frame(4, protocol::kFlagGapBefore | protocol::kFlagLostBefore, 1)), 0U);
  EXPECT_EQ(unflagged_after(frame(1)), 1U) << "a number twice";
  EXPECT_EQ(unflagged_after(frame(9, 0, 0, 2)), 0U) << "another run";
}

TEST(StreamReport, OfEveryThirdFrameTheOthersAreNoGap) {
  EXPECT_EQ(unflagged_after(frame(4), 3), 0U);
  EXPECT_EQ(unflagged_after(frame(7), 3), 1U);
  EXPECT_EQ(unflagged_after(frame(7, protocol::kFlagLostBefore, 1), 3), 0U);
}

}  // namespace
}  // namespace emit::tool
