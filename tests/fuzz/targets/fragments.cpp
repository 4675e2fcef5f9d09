// SPDX-License-Identifier: Apache-2.0
// Fuzz target: UDP fragments put together to frames. The input is a sequence of datagrams, each
// behind a byte of instructions and its length (u16). Bits of the byte: 1 corrects the checksum of
// the frame header in front, 2 that of the one at the end, 4 takes the finished frames, 8 flushes,
// 16 looks at missing ranges and gives the oldest frame up. Bit 32 of the first byte: complete
// frames wait for older ones.
#include <array>
#include <cmath>
#include <vector>

#include "emit/protocol/reassembler.hpp"
#include "fuzz/frame_seal.hpp"
#include "fuzz/fuzz_input.hpp"

namespace {

using namespace emit;

constexpr std::uint32_t kMaxPayloadBytes = 4096;

void check(const protocol::ReceivedFrame& frame) {
  const auto& header = frame.header;
  fuzz::require(frame.pixels.size() == std::size_t{header.width_px} * header.height_px &&
                    frame.pixels.size_bytes() <= kMaxPayloadBytes,
                "a frame has the pixels of its header");
  std::uint64_t missing = 0;
  for (std::size_t i = 0; i < frame.pixels.size(); ++i) {
    if (frame.validity.pixel(i)) continue;
    ++missing;
    fuzz::require(frame.pixels[i] == 0.0F, "missing pixels are 0");
  }
  fuzz::require(missing == frame.missing_px, "missing pixels are counted");
  fuzz::require(frame.complete == (missing == 0), "complete: nothing is missing");
  fuzz::require(((header.flags & protocol::kFlagPartial) != 0) == !frame.complete,
                "partial frames are flagged");
  fuzz::require(((header.flags & protocol::kFlagLostBefore) != 0) == (frame.frames_lost_before > 0),
                "frames after lost ones are flagged");
  fuzz::require(frame.complete || !frame.crc_ok, "only complete frames have a checksum");
  fuzz::require(frame.validity.all(0, frame.pixels.size()) == frame.complete,
                "rows tell the same as pixels");
}

void drain(protocol::Reassembler& reassembler) {
  while (const protocol::ReceivedFrame* frame = reassembler.pop()) {
    check(*frame);
    reassembler.release(frame);
  }
}

/// Checks that the ranges that a client would request lie within the frame, in order, and are
/// missing.
void look_at_missing(protocol::Reassembler& reassembler) {
  std::array<protocol::Reassembler::OpenFrame, 8> open;
  std::array<protocol::ByteRange, 16> ranges;
  for (std::uint16_t stream = 0; stream < 4; ++stream) {
    const std::size_t frames = reassembler.open_frames(stream, open);
    for (std::size_t i = 0; i < frames; ++i) {
      const std::size_t count = reassembler.missing(stream, open[i].frame_id, true, ranges);
      fuzz::require(count > 0, "something is missing of an open frame");
      std::uint64_t end = 0;
      for (std::size_t k = 0; k < count; ++k) {
        fuzz::require(ranges[k].bytes > 0 && (k == 0 || ranges[k].begin > end),
                      "missing ranges are apart and in order");
        end = std::uint64_t{ranges[k].begin} + ranges[k].bytes;
      }
      fuzz::require(end <= kMaxPayloadBytes + 3 * protocol::kFrameHeaderBytes,
                    "they lie within the frame");
    }
    if (frames > 0) reassembler.give_up(stream, open[0].frame_id);
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  protocol::Reassembler::Params params;
  params.max_payload_bytes = kMaxPayloadBytes;
  params.buffers = 3;
  params.max_streams = 2;
  params.fec = {3, 2};
  params.wait_for_missing = size > 0 && (data[0] & 32u) != 0;
  protocol::Reassembler reassembler(params);
  fuzz::InputReader input(fuzz::as_bytes(data, size));
  std::uint64_t pushed = 0;
  while (!input.empty()) {
    const auto instructions = input.number<std::uint8_t>();
    const std::vector<std::byte> datagram = fuzz::read_datagram(input, instructions);
    static_cast<void>(reassembler.push(datagram));
    ++pushed;
    if ((instructions & 8u) != 0) reassembler.flush();
    if ((instructions & 16u) != 0) look_at_missing(reassembler);
    if ((instructions & 4u) != 0) drain(reassembler);
  }
  reassembler.flush();
  drain(reassembler);
  std::uint64_t counted = 0;
  for (const std::uint64_t count : reassembler.counters().fragments) counted += count;
  fuzz::require(counted == pushed, "every datagram is counted once");
  return 0;
}
