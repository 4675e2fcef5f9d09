// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>

namespace emit::server {

/// Set while a consumer is starved. The producer rings its doorbell only then. Both sides exchange
/// the same atomic, so either the producer sees that it is needed, or the last look of the consumer
/// sees what was produced. Thread: any. Real time: RT-safe.
class Shortage {
 public:
  /// Returns what `look` finds. Where it finds nothing, sets the shortage and looks once more.
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
