// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/stream_report.hpp"

#include <gtest/gtest.h>

#include <limits>

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

TEST(StreamReport, PointingErrorsCountWhereTheAxesFollow) {
  StreamReport report;
  report.add(frame(1));
  EXPECT_EQ(report.motion_line(), "") << "no motion simulator is driven";
  const auto with_motion = [&](std::uint64_t number, float error_px, std::uint8_t faults) {
    client::ReceivedFrame out =
        frame(number, faults != 0 ? std::uint32_t{protocol::kFlagMotionFault} : 0U);
    out.header.motion_state = protocol::MotionState::following;
    out.header.motion_faults = faults;
    out.header.pointing_error_px = error_px;
    out.header.display_ns = 1;
    report.add(out);
  };
  with_motion(2, std::numeric_limits<float>::quiet_NaN(), 0);
  with_motion(3, 3.0F, 0);
  with_motion(4, 4.0F, 0);
  with_motion(5, 100.0F, protocol::kMotionLimit);
  EXPECT_EQ(report.pointing_px().count(), 2U);
  EXPECT_EQ(report.motion_line(),
            "motion simulator: 1 of 4 frames flagged; pointing error RMS 3.5355  p99 4.0000  "
            "max 4.0000 px  (2 frames)\n");
}

}  // namespace
}  // namespace emit::tool
