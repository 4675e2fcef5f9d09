// SPDX-License-Identifier: Apache-2.0
// Fuzz target: scenarios. Their scene files need not exist; other files that they name do not
// exist.
#include "emit/config/load.hpp"
#include "fuzz/fuzz_input.hpp"
#include "fuzz/memory_file.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  config::LoadOptions options;
  options.require_scene_files = false;
  options.environment.emplace();
  const auto first = config::load_scenario(fuzz::file_of(fuzz::as_bytes(data, size)), {}, options);
  if (!first) return 0;
  // The printed scenario loads again and then prints the same.
  const std::string text = config::print_scenario(*first);
  const auto again =
      config::load_scenario(fuzz::file_of(std::as_bytes(std::span(text))), {}, options);
  fuzz::require(again && config::print_scenario(*again) == text, "print_scenario() loads again");
  return 0;
}
