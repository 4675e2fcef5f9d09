// SPDX-License-Identifier: Apache-2.0
// Fuzz target: a file of pre-shared keys.
#include "emit/protocol/host_session.hpp"
#include "fuzz/fuzz_input.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  const auto keys = protocol::parse_key_file({reinterpret_cast<const char*>(data), size});
  if (!keys) {
    fuzz::require(!keys.error().text.empty(), "an error says why");
    return 0;
  }
  fuzz::require(!keys->empty() && keys->size() <= protocol::kMaxFileKeys, "1 to 16 keys");
  return 0;
}
