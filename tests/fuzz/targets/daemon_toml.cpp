// SPDX-License-Identifier: Apache-2.0
// Fuzz target: the daemon's configuration.
#include "emit/config/load.hpp"
#include "fuzz/fuzz_input.hpp"
#include "fuzz/memory_file.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  config::LoadOptions options;
  options.environment.emplace();
  const auto first = config::load_daemon(fuzz::file_of(fuzz::as_bytes(data, size)), {}, options);
  if (!first) return 0;
  // The printed configuration loads again and then prints the same.
  const std::string text = config::print_daemon(*first);
  const auto again =
      config::load_daemon(fuzz::file_of(std::as_bytes(std::span(text))), {}, options);
  fuzz::require(again && config::print_daemon(*again) == text, "print_daemon() loads again");
  return 0;
}
