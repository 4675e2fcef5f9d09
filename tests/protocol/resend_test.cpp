// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/resend.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "protocol/frames.hpp"

namespace emit::protocol {
namespace {

constexpr std::uint32_t kPayload = 640;

Reassembler::Params params() {
  Reassembler::Params out;
  out.max_payload_bytes = 48 * 32 * 4;
  out.buffers = 6;
  out.max_open_per_stream = 4;
  out.wait_for_missing = true;
  return out;
}

std::vector<test::Datagram> datagrams(std::uint32_t id) {
  return test::datagrams_of(test::make_frame(48, 32, id), kPayload, id);
}

std::vector<std::uint32_t> drain(Reassembler& reassembler) {
  std::vector<std::uint32_t> ids;
  while (const ReceivedFrame* frame = reassembler.pop()) {
    ids.push_back(frame->frame_id);
    reassembler.release(frame);
  }
  return ids;
}

TEST(Resend, RequestsGoThereAndBack) {
  ResendRequest request;
  request.stream_id = 7;
  request.frame_id = 0xFFFFFFFE;
  request.count = 2;
  request.ranges[0] = {640, 640};
  request.ranges[1] = {3200, 8};
  std::array<std::byte, kMaxResendBytes> bytes;
  const std::size_t length = encode(request, bytes);
  EXPECT_EQ(length, 24u);
  ResendRequest out;
  ASSERT_TRUE(decode_resend(std::span(bytes).first(length), out));
  EXPECT_EQ(out.stream_id, 7u);
  EXPECT_EQ(out.frame_id, 0xFFFFFFFEu);
  ASSERT_EQ(out.count, 2u);
  EXPECT_EQ(out.ranges[1], (ByteRange{3200, 8}));
  for (std::size_t cut = 0; cut < length; ++cut) {
    EXPECT_FALSE(decode_resend(std::span(bytes).first(cut), out)) << cut;
  }
  request.ranges[1] = {0xFFFFFFFC, 8};
  EXPECT_FALSE(decode_resend(std::span(bytes).first(encode(request, bytes)), out));
  request.ranges[1] = {4, 0};
  EXPECT_FALSE(decode_resend(std::span(bytes).first(encode(request, bytes)), out));
  request.count = 0;
  EXPECT_FALSE(decode_resend(std::span(bytes).first(encode(request, bytes)), out));
}

TEST(Resend, WhatMayBeOnItsWayIsLeftOutUnlessAskedFor) {
  Reassembler reassembler(params());
  const auto sent = datagrams(1);
  for (std::size_t i = 0; i + 2 < sent.size(); ++i) {
    if (i != 1) reassembler.push(sent[i]);
  }
  std::array<ByteRange, 8> ranges;
  ASSERT_EQ(reassembler.missing(1, 1, true, ranges), 2u);
  EXPECT_GT(ranges[1].bytes, kPayload);
  ASSERT_EQ(reassembler.missing(1, 1, false, ranges), 1u);
  EXPECT_EQ(ranges[0], (ByteRange{kPayload, kPayload}));
}

TEST(Resend, WhatIsMissingIsToldFrontToBack) {
  Reassembler reassembler(params());
  const auto sent = datagrams(1);
  for (std::size_t i = 0; i < sent.size(); ++i) {
    if (i != 0 && i != 3 && i != 4) reassembler.push(sent[i]);
  }
  std::array<ByteRange, 8> ranges;
  ASSERT_EQ(reassembler.missing(1, 1, true, ranges), 2u);
  EXPECT_EQ(ranges[0], (ByteRange{0, kPayload}));
  EXPECT_EQ(ranges[1], (ByteRange{3 * kPayload, 2 * kPayload}));
  EXPECT_EQ(reassembler.missing(1, 1, true, std::span(ranges).first(1)), 1u);
  EXPECT_EQ(reassembler.missing(1, 2, true, ranges), 0u);
  EXPECT_EQ(reassembler.missing(2, 1, true, ranges), 0u);
  std::array<Reassembler::OpenFrame, 4> open;
  ASSERT_EQ(reassembler.open_frames(1, open), 1u);
  EXPECT_EQ(open[0].frame_id, 1u);
  EXPECT_TRUE(open[0].end_seen);
}

TEST(Resend, NewerFramesWaitForOneThatMayStillBeCompleted) {
  Reassembler reassembler(params());
  const auto first = datagrams(1);
  for (std::size_t i = 1; i < first.size(); ++i) reassembler.push(first[i]);
  for (const auto& d : datagrams(2)) reassembler.push(d);
  for (const auto& d : datagrams(3)) reassembler.push(d);
  EXPECT_TRUE(drain(reassembler).empty());
  std::array<Reassembler::OpenFrame, 4> open;
  EXPECT_EQ(reassembler.open_frames(1, open), 1u) << "complete ones want nothing";
  EXPECT_EQ(reassembler.push(first[0]), FragmentStatus::accepted);
  EXPECT_EQ(drain(reassembler), (std::vector<std::uint32_t>{1, 2, 3}));
  EXPECT_EQ(reassembler.counters().frames_partial, 0u);
}

TEST(Resend, AFrameGivenUpLetsTheNewerOnesGo) {
  Reassembler reassembler(params());
  const auto first = datagrams(1);
  for (std::size_t i = 1; i < first.size(); ++i) reassembler.push(first[i]);
  for (const auto& d : datagrams(2)) reassembler.push(d);
  reassembler.give_up(1, 1);
  EXPECT_EQ(drain(reassembler), (std::vector<std::uint32_t>{1, 2}));
  EXPECT_EQ(reassembler.counters().frames_partial, 1u);
  EXPECT_EQ(reassembler.push(first[0]), FragmentStatus::late);
}

TEST(Resend, BuffersRunningOutPushTheWaitingOnesOutInOrder) {
  Reassembler reassembler(params());
  std::vector<std::uint32_t> ids;
  for (std::uint32_t id = 1; id <= 40; ++id) {
    const auto sent = datagrams(id);
    for (std::size_t i = 0; i < sent.size(); ++i) {
      if (id % 3 != 1 || i != 2) reassembler.push(sent[i]);
    }
    for (const std::uint32_t out : drain(reassembler)) ids.push_back(out);
  }
  reassembler.flush();
  for (const std::uint32_t out : drain(reassembler)) ids.push_back(out);
  ASSERT_EQ(ids.size(), 40u);
  for (std::uint32_t i = 0; i < 40; ++i) EXPECT_EQ(ids[i], i + 1);
  EXPECT_EQ(reassembler.counters().frames_partial, 14u);
}

}  // namespace
}  // namespace emit::protocol
