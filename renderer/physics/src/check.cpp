// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/check.hpp"

#include <atomic>
#include <cstdio>
#include <cstdlib>

namespace emit::physics {
namespace {

void write_to_standard_error(const char* message) {
  std::fprintf(stderr, "%s\n", message);
}

std::atomic<PanicHandler> panic_handler{&write_to_standard_error};

}  // namespace

PanicHandler set_panic_handler(PanicHandler handler) noexcept {
  return panic_handler.exchange(handler != nullptr ? handler : &write_to_standard_error);
}

void panic(const char* file, int line, const std::string& message) {
  const std::string text = std::string(file) + ':' + std::to_string(line) + ": " + message;
  panic_handler.load()(text.c_str());
  std::abort();
}

}  // namespace emit::physics
