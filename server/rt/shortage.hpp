// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>

namespace emit::server {

/// That somebody waits for what others give back: who gives back rings only then. Both sides
/// exchange the same atomic, so either the giver sees that it was wanted or the last look of who
/// wants sees what was given. Thread: any. Real time: RT-safe.
class Shortage {
 public:
  /// What `look` finds; where it finds nothing, says so and looks once more.
  template <class Look>
  [[nodiscard]] auto look(Look look) noexcept {
    auto found = look();
    if (!found) {
      wanted_.exchange(true, std::memory_order_acq_rel);
      found = look();
    }
    return found;
  }
  /// After giving back: true to whoever has to wake who wants.
  [[nodiscard]] bool end() noexcept { return wanted_.exchange(false, std::memory_order_acq_rel); }

 private:
  std::atomic<bool> wanted_{false};
};

}  // namespace emit::server
