// SPDX-License-Identifier: Apache-2.0
// Fuzz target: a client that receives frames, from its hello to the end of the connection. The
// input is one byte, 1 for frames over UDP (none of which arrives), then the daemon's bytes as
// records. The checksums of frame headers are corrected.
#include <vector>

#include "fuzz/daemon_peer.hpp"
#include "fuzz/frame_seal.hpp"

namespace {

using namespace emit;

/// Returns the input with correct checksums of its frame headers.
std::vector<std::byte> sealed(std::span<const std::byte> said) {
  std::vector<std::byte> out(said.begin(), said.end());
  std::span<std::byte> left(out);
  while (left.size() > protocol::kRecordHeaderBytes) {
    std::uint32_t body_bytes = 0;
    std::memcpy(&body_bytes, left.data() + 8, sizeof body_bytes);
    left = left.subspan(protocol::kRecordHeaderBytes);
    fuzz::seal_frame_header(left);
    left = left.subspan(std::min<std::size_t>(body_bytes, left.size()));
  }
  return out;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::InputReader input(fuzz::as_bytes(data, size));
  const bool udp = input.number<std::uint8_t>() == 1;
  auto connection = fuzz::connect_to(sealed(input.rest()), protocol::PeerRole::client);
  if (!connection || !fuzz::announces_small_frames(connection->server())) return 0;
  const auto client = client::make_frame_client(std::move(*connection), udp);
  if (!client->subscribe({})) return 0;
  static_cast<void>(client->receive_buffer_advice());
  for (;;) {
    const auto frame = client->receive(0);
    if (!frame || *frame == nullptr) break;
    fuzz::require((*frame)->pixels.size_bytes() == (*frame)->header.payload_bytes,
                  "a frame has the pixels of its header");
    // The CRC reads every pixel.
    static_cast<void>(protocol::crc32c(std::as_bytes((*frame)->pixels)));
    static_cast<void>(client->take_statuses());
  }
  return 0;
}
