// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/step_input.hpp"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <string_view>

#include "tool/support/interrupt.hpp"

namespace emit::tool {
namespace {

bool goes_on(std::string_view line) {
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line != "q";
}

}  // namespace

bool StepInput::wait_for_line() {
  for (;;) {
    if (const std::size_t end = pending_.find('\n'); end != std::string::npos) {
      const bool next = goes_on(std::string_view(pending_).substr(0, end));
      pending_.erase(0, end + 1);
      return next;
    }
    if (ended_) {
      const bool next = !pending_.empty() && goes_on(pending_);
      pending_.clear();
      return next;
    }
    // A signal may come just before the wait, so that the wait is short.
    constexpr int kSliceMs = 100;
    pollfd wait{fd_, POLLIN, 0};
    const int ready = ::poll(&wait, 1, kSliceMs);
    if (InterruptGuard::interrupted()) return false;
    if (ready == 0 || (ready < 0 && errno == EINTR)) continue;
    std::array<char, 256> bytes{};
    const ssize_t got = ::read(fd_, bytes.data(), bytes.size());
    if (got > 0) {
      pending_.append(bytes.data(), static_cast<std::size_t>(got));
    } else if (got == 0 || errno != EINTR) {
      ended_ = true;
    }
  }
}

}  // namespace emit::tool
