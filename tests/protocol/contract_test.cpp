// SPDX-License-Identifier: Apache-2.0
// Tests that violated preconditions of the protocol library end the program with a message.
#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <vector>

#include "emit/protocol/fragment.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/protocol/parity.hpp"
#include "emit/protocol/pixel_codec.hpp"
#include "emit/protocol/reassembler.hpp"
#include "emit/protocol/resend.hpp"
#include "emit/protocol/shared_ring.hpp"
#include "protocol/frames.hpp"

namespace emit::protocol {
namespace {

TEST(ProtocolContract, FragmenterTakesWholePixels) {
  const std::array<std::byte, kFrameHeaderBytes> header{};
  const std::vector<std::byte> pixels(6);
  EXPECT_DEATH(Fragmenter({}, header, pixels), "pixels.size\\(\\) % 4 == 0U \\(2 == 0\\)");
}

TEST(ProtocolContract, EveryNthFrameIsNotEveryZeroth) {
  EXPECT_DEATH(static_cast<void>(is_every_nth(1, 0)), "every_nth > 0U \\(0 > 0\\)");
}

TEST(ProtocolContract, ParserTakesNoMoreThanItOffered) {
  RecordParser parser({.max_control_bytes = 64});
  EXPECT_DEATH(parser.commit(parser.writable().size() + 1), "count <= capacity_ - end_");
}

TEST(ProtocolContract, ParityNeedsParametersWithinTheirLimits) {
  EXPECT_DEATH(static_cast<void>(ParityGeometry::of({}, 4000, 400)), "params.on\\(\\)");
  EXPECT_DEATH(static_cast<void>(ParityGeometry::of({kMaxFecData + 1, 1}, 4000, 400)),
               "params.valid\\(\\)");
  EXPECT_DEATH(static_cast<void>(ParityGeometry::of({4, 1}, 4000, 0)), "fragment_bytes > 0U");
  EXPECT_DEATH(GroupDecoder({4, kMaxFecParity + 1}), "params.valid\\(\\)");
}

TEST(ProtocolContract, ParityIsReadWhenItIsEncoded) {
  const test::Frame frame = test::make_frame(32, 20, 1);
  const Fragmenter fragments({.max_payload_bytes = 400}, frame.header_bytes, frame.pixels);
  ParityEncoder encoder({2, 1}, fragments);
  encoder.begin();
  EXPECT_DEATH(static_cast<void>(encoder.datagrams(0, 1)), "encoded_groups_ == geometry_.groups");
  while (!encoder.encode_some(fragments, 1)) continue;
  EXPECT_FALSE(encoder.datagrams(0, encoder.datagram_count()).empty());
  EXPECT_DEATH(static_cast<void>(encoder.datagrams(1, encoder.datagram_count())), "datagram_count");
  const Fragmenter other({.max_payload_bytes = 800}, frame.header_bytes, frame.pixels);
  EXPECT_DEATH(encoder.encode_some(other, 1), "fragments.payload_bytes\\(\\)");
}

TEST(ProtocolContract, PixelEncoderTakesWholePixels) {
  EXPECT_DEATH(PixelEncoder(6), "max_pixel_bytes");
}

TEST(ProtocolContract, FramesAreReleasedOnce) {
  const test::Frame sent = test::make_frame(16, 8, 1);
  Reassembler reassembler({.max_payload_bytes = static_cast<std::uint32_t>(sent.pixels.size())});
  for (const auto& datagram : test::datagrams_of(sent, 1440, 1)) reassembler.push(datagram);
  const ReceivedFrame* frame = reassembler.pop();
  ASSERT_NE(frame, nullptr);
  reassembler.release(frame);
  EXPECT_DEATH(reassembler.release(frame), "held != slots_.end\\(\\)");
}

TEST(ProtocolContract, ResendRequestsHoldALimitedNumberOfRanges) {
  ResendRequest request;
  request.count = kMaxResendRanges + 1;
  std::array<std::byte, kMaxResendBytes> out{};
  EXPECT_DEATH(encode(request, out), "request.count <= kMaxResendRanges \\(129 <= 128\\)");
}

TEST(ProtocolContract, RingsHaveValidParametersAndAlignedMemory) {
  RingParams params;
  params.plane_bytes = {512};
  params.plane_of_channel = {1};
  EXPECT_DEATH(static_cast<void>(ring_bytes(params)), "plane < params.plane_bytes.size\\(\\)");
  params.plane_of_channel = {0};
  params.slots = kMinRingSlots - 1;
  EXPECT_DEATH(static_cast<void>(ring_bytes(params)), "params.slots >= kMinRingSlots \\(2 >= 3\\)");

  alignas(64) static std::array<std::byte, 1024> memory{};
  params.slots = kMinRingSlots;
  EXPECT_DEATH(RingWriter(memory, params), "memory.size\\(\\) >= layout.object_bytes");
  EXPECT_DEATH(static_cast<void>(RingReader::open(std::span(memory).subspan(4))), "is_aligned");
  EXPECT_FALSE(RingReader::open(memory).has_value());
}

}  // namespace
}  // namespace emit::protocol
