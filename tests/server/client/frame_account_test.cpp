// SPDX-License-Identifier: Apache-2.0
#include "client/frame_account.hpp"

#include <gtest/gtest.h>

namespace emit::server {
namespace {

protocol::FrameHeader header(std::uint64_t number, std::uint32_t flags = 0, std::uint64_t run = 1) {
  protocol::FrameHeader out;
  out.run_id = run;
  out.frame_number = number;
  out.flags = flags;
  return out;
}

TEST(FrameAccount, TellsSkippedFramesFromLostOnes) {
  client::FrameAccount account;
  account.take(header(5));
  EXPECT_EQ(account.counters.lost, 0U) << "the first one";
  account.take(header(8), 2);
  EXPECT_EQ(account.counters.lost, 2U) << "by their ids";
  account.take(header(10));
  EXPECT_EQ(account.counters.lost, 3U) << "by its number";
  account.take(header(14, protocol::kFlagGapBefore), 1);
  EXPECT_EQ(account.counters.lost, 4U);
  EXPECT_EQ(account.counters.skipped, 2U) << "two of three";
  EXPECT_EQ(account.counters.gaps, 1U);
  account.take(header(1, 0, 2), 1);
  EXPECT_EQ(account.counters.lost, 5U) << "numbers of another run tell nothing, ids do";
}

TEST(FrameAccount, FramesWithoutANumberStandForOneEach) {
  client::FrameAccount account;
  account.set_every_nth(3);
  account.take(header(1));
  account.take_unknown(1);  // 4 was lost, this is 7
  account.take(header(10));
  EXPECT_EQ(account.counters.lost, 1U);
  account.take(header(16));
  EXPECT_EQ(account.counters.lost, 2U);
}

}  // namespace
}  // namespace emit::server
