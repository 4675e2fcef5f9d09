// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/reassembler.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <vector>

#include "protocol/frames.hpp"
#include "protocol/received_frames.hpp"

namespace emit::protocol {
namespace {

using test::Datagram;
using test::expect_true_to;
using test::Frame;

constexpr std::uint32_t kWidthPx = 48;
constexpr std::uint32_t kHeightPx = 32;
constexpr std::uint32_t kPayload = 640;

Reassembler::Params params() {
  return {.max_payload_bytes = kWidthPx * kHeightPx * 4, .buffers = 6, .max_open_per_stream = 2};
}

std::uint64_t count(const Reassembler& reassembler, FragmentStatus status) {
  return reassembler.counters().fragments[static_cast<std::size_t>(status)];
}

TEST(Reassembler, GivesACompleteFrameFromFragmentsInAnyOrder) {
  const Frame frame = test::make_frame(kWidthPx, kHeightPx, 7);
  auto datagrams = test::datagrams_of(frame, kPayload, 1);
  std::mt19937 random(1);
  for (int round = 0; round < 20; ++round) {
    Reassembler reassembler(params());
    std::ranges::shuffle(datagrams, random);
    for (const Datagram& datagram : datagrams) {
      EXPECT_EQ(reassembler.pop(), nullptr);
      EXPECT_EQ(reassembler.push(datagram), FragmentStatus::accepted);
    }
    const ReceivedFrame* received = reassembler.pop();
    ASSERT_NE(received, nullptr);
    EXPECT_TRUE(received->complete);
    EXPECT_TRUE(received->header_known);
    EXPECT_TRUE(received->crc_ok);
    EXPECT_EQ(received->header.frame_number, 7u);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(received->pixels.data()) % 64, 0u);
    expect_true_to(*received, frame);
    reassembler.release(received);
  }
}

TEST(Reassembler, AFrameIsPartialByWhatArrivedWhateverItsHeaderClaims) {
  Frame frame = test::make_frame(kWidthPx, kHeightPx, 7);
  frame.header.flags = kReceiverFlags | kFlagLate;
  encode(frame.header, frame.header_bytes);
  Reassembler reassembler(params());
  for (const Datagram& datagram : test::datagrams_of(frame, kPayload, 1)) {
    EXPECT_EQ(reassembler.push(datagram), FragmentStatus::accepted);
  }
  const ReceivedFrame* received = reassembler.pop();
  ASSERT_NE(received, nullptr);
  expect_true_to(*received, frame);
  EXPECT_EQ(received->header.flags, kFlagLate);
}

TEST(Reassembler, OneLostFragmentCostsOnlyItsOwnPixels) {
  const Frame frame = test::make_frame(kWidthPx, kHeightPx, 3);
  const auto datagrams = test::datagrams_of(frame, kPayload, 1);
  for (std::size_t lost = 0; lost < datagrams.size(); ++lost) {
    Reassembler reassembler(params());
    for (std::size_t i = 0; i < datagrams.size(); ++i) {
      if (i != lost) reassembler.push(datagrams[i]);
    }
    EXPECT_EQ(reassembler.pop(), nullptr);
    reassembler.flush();
    const ReceivedFrame* received = reassembler.pop();
    ASSERT_NE(received, nullptr) << lost;
    EXPECT_TRUE(received->header_known) << lost;
    EXPECT_LE(received->missing_px, kPayload / 4);
    expect_true_to(*received, frame);
  }
}

TEST(Reassembler, WithBothHeadersLostTheSizeOfThePreviousFrameServes) {
  Reassembler reassembler(params());
  for (std::uint32_t id = 1; id <= 2; ++id) {
    const Frame frame = test::make_frame(kWidthPx, kHeightPx, id);
    const auto datagrams = test::datagrams_of(frame, kPayload, id);
    for (std::size_t i = 0; i < datagrams.size(); ++i) {
      const bool header = i == 0 || i + 1 == datagrams.size();
      if (id == 1 || !header) reassembler.push(datagrams[i]);
    }
    reassembler.flush();
    const ReceivedFrame* received = reassembler.pop();
    ASSERT_NE(received, nullptr);
    EXPECT_EQ(received->header_known, id == 1);
    EXPECT_EQ(received->header.width_px, kWidthPx);
    EXPECT_EQ(received->header.sim_time_ns, frame.header.sim_time_ns);
    expect_true_to(*received, frame);
    reassembler.release(received);
  }
}

TEST(Reassembler, WithoutAnyHeaderAFrameIsCountedAsUnusable) {
  Reassembler reassembler(params());
  reassembler.push(test::datagrams_of(test::make_frame(kWidthPx, kHeightPx, 1), kPayload, 1)[2]);
  reassembler.flush();
  EXPECT_EQ(reassembler.pop(), nullptr);
  EXPECT_EQ(reassembler.counters().frames_unusable, 1u);
}

TEST(Reassembler, ANewerCompleteFramePushesTheOlderPartialOneOutFirst) {
  Reassembler reassembler(params());
  const auto first = test::datagrams_of(test::make_frame(kWidthPx, kHeightPx, 1), kPayload, 1);
  const auto second = test::datagrams_of(test::make_frame(kWidthPx, kHeightPx, 2), kPayload, 2);
  for (std::size_t i = 1; i < first.size(); ++i) reassembler.push(first[i]);
  for (const Datagram& datagram : second) reassembler.push(datagram);
  EXPECT_EQ(reassembler.push(first[0]), FragmentStatus::late);
  const ReceivedFrame* partial = reassembler.pop();
  ASSERT_NE(partial, nullptr);
  EXPECT_EQ(partial->frame_id, 1u);
  EXPECT_FALSE(partial->complete);
  const ReceivedFrame* whole = reassembler.pop();
  ASSERT_NE(whole, nullptr);
  EXPECT_EQ(whole->frame_id, 2u);
  EXPECT_TRUE(whole->complete);
}

TEST(Reassembler, InterleavedFramesOfSeveralStreamsAreKeptApart) {
  Reassembler reassembler(params());
  std::vector<Frame> frames;
  std::vector<std::vector<Datagram>> datagrams;
  for (std::uint16_t stream = 0; stream < 3; ++stream) {
    frames.push_back(test::make_frame(kWidthPx, kHeightPx, 100u + stream));
    datagrams.push_back(test::datagrams_of(frames.back(), kPayload, 5, stream));
  }
  for (std::size_t i = 0; i < datagrams[0].size(); ++i) {
    for (const auto& of_stream : datagrams) {
      EXPECT_EQ(reassembler.push(of_stream[i]), FragmentStatus::accepted);
    }
  }
  for (std::uint16_t stream = 0; stream < 3; ++stream) {
    const ReceivedFrame* received = reassembler.pop();
    ASSERT_NE(received, nullptr);
    ASSERT_EQ(received->stream_id, stream);
    expect_true_to(*received, frames[stream]);
    EXPECT_TRUE(received->crc_ok);
  }
}

TEST(Reassembler, DuplicatesChangeNothing) {
  Reassembler reassembler(params());
  const auto datagrams = test::datagrams_of(test::make_frame(kWidthPx, kHeightPx, 1), kPayload, 1);
  EXPECT_EQ(reassembler.push(datagrams[0]), FragmentStatus::accepted);
  EXPECT_EQ(reassembler.push(datagrams[0]), FragmentStatus::duplicate);
  for (std::size_t i = 1; i < datagrams.size(); ++i) reassembler.push(datagrams[i]);
  EXPECT_EQ(reassembler.push(datagrams[3]), FragmentStatus::late);
  EXPECT_EQ(reassembler.counters().frames_complete, 1u);
}

/// Returns a fragment of the frame with a header other than the sender's.
Datagram forged(FragmentHeader header, std::size_t payload) {
  header.payload_bytes = static_cast<std::uint16_t>(payload);
  Datagram datagram(kFragmentHeaderBytes + payload, std::byte{0x77});
  encode(header, std::span(datagram).first<kFragmentHeaderBytes>());
  return datagram;
}

TEST(Reassembler, FragmentsThatContradictTheirFrameAreRefused) {
  Reassembler reassembler(params());
  const Frame frame = test::make_frame(kWidthPx, kHeightPx, 1);
  const auto datagrams = test::datagrams_of(frame, kPayload, 1);
  FragmentHeader header;
  ASSERT_EQ(decode_fragment_header(datagrams[1], header), FragmentStatus::accepted);
  reassembler.push(datagrams[1]);

  auto shifted = header;
  shifted.byte_offset += 4;
  EXPECT_EQ(reassembler.push(forged(shifted, kPayload)), FragmentStatus::overlap);
  auto too_long = header;
  too_long.byte_offset = 0;
  too_long.flags = kFragmentFirst;
  EXPECT_EQ(reassembler.push(forged(too_long, kPayload + 4)), FragmentStatus::overlap);
  auto grown = header;
  grown.byte_offset = 2 * kPayload;
  grown.total_bytes += 4;
  EXPECT_EQ(reassembler.push(forged(grown, kPayload)), FragmentStatus::inconsistent);
  auto other_time = header;
  other_time.byte_offset = 2 * kPayload;
  other_time.sim_time_ns += 1;
  EXPECT_EQ(reassembler.push(forged(other_time, kPayload)), FragmentStatus::inconsistent);
  auto huge = header;
  huge.total_bytes = 0xFFFFFFFC;
  EXPECT_EQ(reassembler.push(forged(huge, kPayload)), FragmentStatus::oversize);

  for (const Datagram& datagram : datagrams) reassembler.push(datagram);
  const ReceivedFrame* received = reassembler.pop();
  ASSERT_NE(received, nullptr);
  EXPECT_TRUE(received->complete);
  expect_true_to(*received, frame);
}

TEST(Reassembler, ACorruptPayloadIsDeliveredAsSuch) {
  Reassembler reassembler(params());
  auto datagrams = test::datagrams_of(test::make_frame(kWidthPx, kHeightPx, 1), kPayload, 1);
  datagrams[2][100] ^= std::byte{1};
  for (const Datagram& datagram : datagrams) reassembler.push(datagram);
  const ReceivedFrame* received = reassembler.pop();
  ASSERT_NE(received, nullptr);
  EXPECT_TRUE(received->complete);
  EXPECT_FALSE(received->crc_ok);
  EXPECT_EQ(reassembler.counters().crc_mismatches, 1u);
}

TEST(Reassembler, CountsFramesOfWhichNothingArrivedAcrossTheWrapOfTheId) {
  Reassembler reassembler(params());
  std::uint32_t lost = 0;
  for (const std::uint32_t id : {0xFFFFFFFEu, 0xFFFFFFFFu, 2u, 3u}) {
    for (const auto& d :
         test::datagrams_of(test::make_frame(kWidthPx, kHeightPx, id), kPayload, id)) {
      reassembler.push(d);
    }
    const ReceivedFrame* received = reassembler.pop();
    ASSERT_NE(received, nullptr);
    lost += received->frames_lost_before;
    EXPECT_EQ(received->header.flags & kFlagLostBefore, id == 2u ? kFlagLostBefore : 0u) << id;
    reassembler.release(received);
  }
  EXPECT_EQ(lost, 2u);
  EXPECT_EQ(reassembler.counters().frames_lost, 2u);
}

TEST(Reassembler, FollowsASenderThatStartsItsIdsAgain) {
  Reassembler reassembler(params());
  std::uint64_t delivered = 0;
  auto send = [&](std::uint32_t id) {
    for (const auto& d :
         test::datagrams_of(test::make_frame(kWidthPx, kHeightPx, id), kPayload, id)) {
      reassembler.push(d);
      while (const ReceivedFrame* received = reassembler.pop()) {
        delivered += received->complete ? 1 : 0;
        reassembler.release(received);
      }
    }
  };
  send(100000);
  for (std::uint32_t id = 1; id <= 6; ++id) send(id);
  EXPECT_EQ(reassembler.counters().resyncs, 1u);
  EXPECT_GE(delivered, 5u);
}

TEST(Reassembler, HeldBuffersAreMissingButNothingBreaks) {
  auto few = params();
  few.buffers = 3;
  Reassembler reassembler(few);
  std::vector<const ReceivedFrame*> held;
  for (std::uint32_t id = 1; id <= 5; ++id) {
    const Frame frame = test::make_frame(kWidthPx, kHeightPx, id);
    for (const auto& d : test::datagrams_of(frame, kPayload, id)) reassembler.push(d);
    if (const ReceivedFrame* received = reassembler.pop()) held.push_back(received);
  }
  ASSERT_EQ(held.size(), 3u);
  EXPECT_GT(count(reassembler, FragmentStatus::no_buffer), 0u);
  expect_true_to(*held[0], test::make_frame(kWidthPx, kHeightPx, 1));
  for (const auto* frame : held) reassembler.release(frame);
  const Frame next = test::make_frame(kWidthPx, kHeightPx, 6);
  for (const auto& d : test::datagrams_of(next, kPayload, 6)) reassembler.push(d);
  const ReceivedFrame* received = reassembler.pop();
  ASSERT_NE(received, nullptr);
  expect_true_to(*received, next);
}

TEST(Reassembler, RefusesStreamsBeyondItsLimit) {
  auto one = params();
  one.max_streams = 1;
  Reassembler reassembler(one);
  const Frame frame = test::make_frame(kWidthPx, kHeightPx, 1);
  EXPECT_EQ(reassembler.push(test::datagrams_of(frame, kPayload, 1, 1)[0]),
            FragmentStatus::accepted);
  EXPECT_EQ(reassembler.push(test::datagrams_of(frame, kPayload, 1, 2)[0]),
            FragmentStatus::too_many_streams);
}

struct NetworkCase {
  double loss;
  double duplication;
  std::size_t reorder_window;
};

class ReassemblerNetwork : public ::testing::TestWithParam<NetworkCase> {};

/// The frames that come out equal the sent ones, in order, and every frame and fragment is counted,
/// for every behaviour of the network.
TEST_P(ReassemblerNetwork, AccountsForEveryFrame) {
  const NetworkCase network = GetParam();
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> chance(0.0, 1.0);
    std::map<std::uint32_t, Frame> sent;
    std::vector<Datagram> wire;
    constexpr std::uint32_t kFrames = 30;
    for (std::uint32_t id = 1; id <= kFrames; ++id) {
      const Frame frame = test::make_frame(kWidthPx, kHeightPx, id);
      for (auto& datagram : test::datagrams_of(frame, kPayload, id)) {
        if (chance(random) < network.loss) continue;
        if (chance(random) < network.duplication) wire.push_back(datagram);
        wire.push_back(std::move(datagram));
      }
      sent.emplace(id, frame);
    }
    if (network.reorder_window > 0) {  // no datagram moves farther than the window
      std::multimap<std::size_t, Datagram> arrival;
      for (std::size_t i = 0; i < wire.size(); ++i) {
        arrival.emplace(i + random() % network.reorder_window, std::move(wire[i]));
      }
      wire.clear();
      for (auto& [time, datagram] : arrival) wire.push_back(std::move(datagram));
    }

    Reassembler reassembler(params());
    std::uint32_t last_id = 0;
    std::uint64_t complete = 0;
    std::uint64_t partial = 0;
    auto drain = [&] {
      while (const ReceivedFrame* received = reassembler.pop()) {
        ASSERT_GT(received->frame_id, last_id);
        if (last_id != 0) {
          ASSERT_EQ(received->frames_lost_before, received->frame_id - last_id - 1);
        }
        last_id = received->frame_id;
        ++(received->complete ? complete : partial);
        expect_true_to(*received, sent.at(received->frame_id));
        if (received->complete && received->header_known) {
          EXPECT_TRUE(received->crc_ok);
        }
        reassembler.release(received);
      }
    };
    for (const Datagram& datagram : wire) {
      reassembler.push(datagram);
      drain();
    }
    reassembler.flush();
    drain();

    const ReassemblerCounters& counters = reassembler.counters();
    EXPECT_EQ(counters.frames_complete, complete);
    EXPECT_EQ(counters.frames_partial, partial);
    std::uint64_t fragments = 0;
    for (const std::uint64_t n : counters.fragments) fragments += n;
    EXPECT_EQ(fragments, wire.size());
    EXPECT_LE(complete + partial + counters.frames_unusable + counters.frames_lost, kFrames);
    if (network.loss == 0.0 && network.reorder_window <= 10) {
      EXPECT_EQ(complete, kFrames);
    }
    if (network.loss > 0.0 && network.reorder_window == 0 && network.loss < 0.5) {
      EXPECT_GT(partial, 0u);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Networks, ReassemblerNetwork,
                         ::testing::Values(NetworkCase{0.0, 0.0, 0}, NetworkCase{0.0, 0.3, 0},
                                           NetworkCase{0.0, 0.0, 10}, NetworkCase{0.05, 0.0, 0},
                                           NetworkCase{0.2, 0.2, 10}, NetworkCase{0.7, 0.1, 40},
                                           NetworkCase{0.02, 0.5, 100}));

}  // namespace
}  // namespace emit::protocol
