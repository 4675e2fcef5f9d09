// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstdint>
#include <functional>

#include "telemetry/progress.hpp"
#include "tool/support/interrupt.hpp"

namespace emit::tool {

/// The bars of the commands are those of the daemon.
using server::Progress;

/// Number of parts that a bar has for a work that reports the share done.
inline constexpr std::uint64_t kShareParts = 1000;

/// Returns a function that a long work calls with the share done, 0..1. It advances `bar` by up to
/// kShareParts from `begin` on, and returns false once the user interrupts. `bar` outlives it.
[[nodiscard]] inline std::function<bool(double done_frac)> share_of(Progress& bar,
                                                                    std::uint64_t begin = 0) {
  return [&bar, begin](double done_frac) {
    constexpr auto kParts = static_cast<double>(kShareParts);
    bar.advance_to(begin + static_cast<std::uint64_t>(kParts * std::clamp(done_frac, 0.0, 1.0)));
    return !InterruptGuard::interrupted();
  };
}

}  // namespace emit::tool
