// SPDX-License-Identifier: Apache-2.0
// Fuzz target: atmospheres, as tables by range and elevation or as terms.
#include "fuzz/fuzz_input.hpp"
#include "fuzz/memory_file.hpp"
#include "resolve/resolve.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  static const std::vector<std::string> bands = config::known_band_names({});
  const auto atmospheres =
      config::load_atmosphere_csv(fuzz::file_of(fuzz::as_bytes(data, size)), bands);
  fuzz::require(!atmospheres || !atmospheres->empty(), "a table without rows is an error");
  return 0;
}
