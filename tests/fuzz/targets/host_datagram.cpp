// SPDX-License-Identifier: Apache-2.0
// Fuzz target: one datagram to the host port.
#include <algorithm>
#include <memory>
#include <vector>

#include "emit/protocol/codec.hpp"
#include "fuzz/fuzz_input.hpp"
#include "fuzz/sound_pose.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  static protocol::HostFrameDecoder decoder;
  static protocol::HostFrameEncoder encoder;
  static const auto frame = std::make_unique<protocol::HostFrameData>();
  static const auto again = std::make_unique<protocol::HostFrameData>();
  if (protocol::decode_host_frame(fuzz::as_bytes(data, size), decoder, *frame) !=
      protocol::DecodeStatus::ok) {
    return 0;
  }
  fuzz::require_sound(*frame);
  // An accepted frame can be encoded again, and then decodes to the same.
  const auto encoded = encoder.encode(*frame);
  fuzz::require(!encoded.empty(), "an accepted host frame can be encoded");
  const std::vector<std::byte> first(encoded.begin(), encoded.end());
  fuzz::require(protocol::decode_host_frame(first, decoder, *again) == protocol::DecodeStatus::ok,
                "an encoded host frame is accepted");
  fuzz::require(std::ranges::equal(encoder.encode(*again), first),
                "decoding and encoding changes no bit");
  return 0;
}
