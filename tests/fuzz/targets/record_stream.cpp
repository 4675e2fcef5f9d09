// SPDX-License-Identifier: Apache-2.0
// Fuzz target: the framing of a TCP connection, in pieces of any size, and the contents of the
// records. The input is one byte for the size of the pieces, then the stream.
#include <memory>
#include <vector>

#include "emit/protocol/codec.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/v1/control.pb.h"
#include "fuzz/fuzz_input.hpp"
#include "fuzz/sound_pose.hpp"

namespace {

using namespace emit;
using Bytes = std::span<const std::byte>;

constexpr protocol::RecordLimits kLimits{4096, 8192};

void take_host_frame(Bytes bytes) {
  static protocol::HostFrameDecoder decoder;
  static const auto frame = std::make_unique<protocol::HostFrameData>();
  if (protocol::decode_host_frame(bytes, decoder, *frame) == protocol::DecodeStatus::ok) {
    fuzz::require_sound(*frame);
  }
}

void take(const protocol::Record& record) {
  if (record.kind == protocol::RecordKind::host_frame) {
    take_host_frame(record.body);
  } else if (record.kind == protocol::RecordKind::control) {
    if (const Bytes inner = protocol::host_frame_in_control_record(record.body); !inner.empty()) {
      take_host_frame(inner);
    }
    v1::ControlRecord message;
    static_cast<void>(protocol::parse_control_record(record.body, message));
  } else if (record.kind == protocol::RecordKind::frame) {
    if (const auto frame = protocol::decode_frame_record(record.body)) {
      fuzz::require(frame->pixels.size() == frame->header.payload_bytes &&
                        frame->pixels.size() <= record.body.size(),
                    "pixels lie within the record");
      static_cast<void>(protocol::payload_crc_matches(*frame));
    }
  }
}

struct Outcome {
  std::size_t records = 0;
  std::size_t body_bytes = 0;
  protocol::ParseStatus status = protocol::ParseStatus::need_more;
  bool operator==(const Outcome&) const = default;
};

Outcome parse(protocol::RecordParser& parser, Bytes stream, std::size_t most, bool use) {
  parser.reset();
  Outcome outcome;
  while (outcome.status == protocol::ParseStatus::need_more && !stream.empty()) {
    const auto space = parser.writable();
    fuzz::require(!space.empty(), "there is room for more");
    const std::size_t count = std::min({most, space.size(), stream.size()});
    std::copy_n(stream.begin(), count, space.begin());
    parser.commit(count);
    stream = stream.subspan(count);
    protocol::Record record;
    while ((outcome.status = parser.next(record)) == protocol::ParseStatus::record) {
      ++outcome.records;
      outcome.body_bytes += record.body.size();
      if (use) take(record);
    }
  }
  return outcome;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static protocol::RecordParser whole(kLimits);
  static protocol::RecordParser pieces(kLimits);
  fuzz::InputReader input(fuzz::as_bytes(data, size));
  const std::size_t most = 1 + std::size_t{input.number<std::uint8_t>()};
  const Bytes stream = input.rest();
  fuzz::require(parse(whole, stream, ~std::size_t{0}, true) == parse(pieces, stream, most, false),
                "records do not depend on the pieces they come in");
  return 0;
}
