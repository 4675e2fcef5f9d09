// SPDX-License-Identifier: Apache-2.0
// Fuzz target: seeker poses as CSV.
#include "emit/protocol/record/pose_csv.hpp"

#include <limits>

#include "fuzz/fuzz_input.hpp"
#include "fuzz/memory_file.hpp"
#include "fuzz/sound_pose.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  auto reader = protocol::PoseCsvReader::open(fuzz::file_of(fuzz::as_bytes(data, size)));
  if (!reader) return 0;
  std::int64_t before_ns = std::numeric_limits<std::int64_t>::min();
  for (;;) {
    const auto more = reader->next();
    if (!more || !*more) break;
    fuzz::require_sound(reader->host());
    fuzz::require(reader->host().sim_time_ns >= before_ns, "time does not go back");
    before_ns = reader->host().sim_time_ns;
  }
  return 0;
}
