// SPDX-License-Identifier: Apache-2.0
// Fuzz target: weather tables.
#include "fuzz/fuzz_input.hpp"
#include "fuzz/memory_file.hpp"
#include "resolve/resolve.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  const auto table = config::load_weather_csv(fuzz::file_of(fuzz::as_bytes(data, size)));
  for (std::size_t i = 1; table && i < table->size(); ++i) {
    fuzz::require((*table)[i - 1].sim_time_ns < (*table)[i].sim_time_ns, "rows go up");
  }
  return 0;
}
