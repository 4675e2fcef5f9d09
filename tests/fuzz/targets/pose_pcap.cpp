// SPDX-License-Identifier: Apache-2.0
// Fuzz target: host frames in network captures (pcap and pcapng).
#include "emit/protocol/record/pose_pcap.hpp"

#include "fuzz/fuzz_input.hpp"
#include "fuzz/memory_file.hpp"
#include "fuzz/sound_pose.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  const auto& file = fuzz::file_of(fuzz::as_bytes(data, size));
  static_cast<void>(protocol::PosePcapReader::is_capture(file));
  auto reader = protocol::PosePcapReader::open(file, protocol::kDefaultHostPort);
  if (!reader) return 0;
  for (;;) {
    const auto more = reader->next();
    if (!more || !*more) break;
    fuzz::require_sound(reader->host());
  }
  static_cast<void>(reader->notes());
  return 0;
}
