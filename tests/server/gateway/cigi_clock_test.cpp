// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "gateway/cigi_clock.hpp"

namespace emit::server {
namespace {

using Verdict = CigiClock::Verdict;
using protocol::cigi::IgControl;

constexpr std::int64_t kPeriodNs = 10'000'000;

IgControl stamped(std::uint32_t frame, std::uint32_t ticks) {
  IgControl out;
  out.host_frame = frame;
  out.timestamp_ticks = ticks;
  out.timestamp_valid = true;
  return out;
}
IgControl bare(std::uint32_t frame) {
  IgControl out;
  out.host_frame = frame;
  return out;
}

TEST(CigiClock, NobodyHasATimeBeforeTheStart) {
  CigiClock clock(kPeriodNs);
  EXPECT_EQ(clock.take(bare(1)), Verdict::restart);
}

TEST(CigiClock, TimeFollowsTheStampsAcrossTheirWrap) {
  CigiClock clock(kPeriodNs);
  clock.start(5'000);
  EXPECT_EQ(clock.take(stamped(7, 0xffff'fff0U)), Verdict::accept);
  EXPECT_EQ(clock.time_ns(), 5'000);
  // 40 messages are lost, and the stamps wrap in between.
  EXPECT_EQ(clock.take(stamped(48, 0x10U)), Verdict::accept);
  EXPECT_EQ(clock.time_ns(), 5'000 + 0x20 * 10'000);
  EXPECT_EQ(clock.number(), 48U);
}

TEST(CigiClock, WithoutStampsTimeFollowsTheNumbersAcrossTheirWrap) {
  CigiClock clock(kPeriodNs);
  clock.start(0);
  EXPECT_EQ(clock.take(bare(0xffff'fffeU)), Verdict::accept);
  EXPECT_EQ(clock.take(bare(3)), Verdict::accept);
  EXPECT_EQ(clock.time_ns(), 5 * kPeriodNs);
  EXPECT_EQ(clock.number(), 0x1'0000'0003U) << "numbers go on beyond 32 bits";
}

TEST(CigiClock, StampsThatComeAndGoKeepTheTime) {
  CigiClock clock(kPeriodNs);
  clock.start(0);
  EXPECT_EQ(clock.take(bare(1)), Verdict::accept);
  EXPECT_EQ(clock.take(stamped(2, 900)), Verdict::accept);
  EXPECT_EQ(clock.time_ns(), kPeriodNs);
  EXPECT_EQ(clock.take(stamped(3, 1900)), Verdict::accept);
  EXPECT_EQ(clock.time_ns(), 2 * kPeriodNs);
  EXPECT_EQ(clock.take(bare(5)), Verdict::accept);
  EXPECT_EQ(clock.time_ns(), 4 * kPeriodNs);
}

TEST(CigiClock, WhereStampsAreNeededAMessageWithoutOneHasNoTime) {
  CigiClock clock(0);
  clock.start(0);
  EXPECT_EQ(clock.take(bare(1)), Verdict::timeless);
  EXPECT_EQ(clock.take(stamped(2, 100)), Verdict::accept);
  EXPECT_EQ(clock.take(bare(3)), Verdict::timeless);
  EXPECT_EQ(clock.take(stamped(4, 300)), Verdict::accept);
  EXPECT_EQ(clock.time_ns(), 200 * 10'000);
}

TEST(CigiClock, RepeatedAndOvertakenMessagesMoveNothing) {
  CigiClock clock(kPeriodNs);
  clock.start(0);
  EXPECT_EQ(clock.take(stamped(10, 1000)), Verdict::accept);
  EXPECT_EQ(clock.take(stamped(12, 3000)), Verdict::accept);
  EXPECT_EQ(clock.take(stamped(12, 3000)), Verdict::repeated);
  EXPECT_EQ(clock.take(stamped(11, 2000)), Verdict::old);
  EXPECT_EQ(clock.take(stamped(13, 2500)), Verdict::old) << "its stamp is older";
  EXPECT_EQ(clock.time_ns(), 2000 * 10'000);
  EXPECT_EQ(clock.take(stamped(14, 5000)), Verdict::accept);
  EXPECT_EQ(clock.time_ns(), 4000 * 10'000);
}

TEST(CigiClock, AHostThatCountsFromTheBeginningAgainIsNotLockedOut) {
  CigiClock clock(kPeriodNs);
  clock.start(0);
  EXPECT_EQ(clock.take(bare(100'000)), Verdict::accept);
  int old = 0;
  std::uint32_t frame = 1;
  while (clock.take(bare(frame)) == Verdict::old) {
    ++old;
    ++frame;
    ASSERT_LT(old, 100);
  }
  EXPECT_EQ(old, 7);
  EXPECT_EQ(clock.take(bare(frame + 1)), Verdict::restart) << "until somebody starts the clock";
  clock.start(0);
  EXPECT_EQ(clock.take(bare(frame + 1)), Verdict::accept);
}

TEST(CigiClock, ScatteredLateMessagesAreNoRestart) {
  CigiClock clock(kPeriodNs);
  clock.start(0);
  EXPECT_EQ(clock.take(bare(1000)), Verdict::accept);
  for (std::uint32_t frame = 900; frame > 800; --frame) {
    EXPECT_EQ(clock.take(bare(frame)), Verdict::old);
  }
  EXPECT_EQ(clock.take(bare(1001)), Verdict::accept);
}

}  // namespace
}  // namespace emit::server
