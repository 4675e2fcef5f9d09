// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <stdexcept>
#include <string>

#include "emit/physics/check.hpp"

namespace emit::test {

/// Runs `body` with a panic handler that throws. Returns the message of the check that failed, or
/// an empty text if none failed. A check inside a noexcept function needs EXPECT_DEATH instead.
template <class Body>
[[nodiscard]] std::string failed_check(const Body& body) {
  struct Handler {
    physics::PanicHandler before =
        physics::set_panic_handler([](const char* message) { throw std::logic_error(message); });
    ~Handler() { physics::set_panic_handler(before); }
  };
  const Handler handler;
  try {
    body();
  } catch (const std::logic_error& error) {
    return error.what();
  }
  return {};
}

}  // namespace emit::test
