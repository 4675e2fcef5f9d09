// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "rt/counters.hpp"
#include "rt/spsc_ring.hpp"
#include "telemetry/event.hpp"

namespace emit::server {

/// One agent's way to say what happened. Thread: that agent's. RT-safe.
class EventLog {
 public:
  EventLog(std::size_t capacity, Counters& counters) : ring_(capacity), counters_(counters) {}

  void push(EventKind kind, std::uint64_t a = 0, std::uint64_t b = 0,
            std::string_view text = {}) noexcept {
    Event* event = ring_.claim();
    if (event == nullptr) {
      counters_.add(Counter::events_dropped);
      return;
    }
    event->kind = kind;
    event->a = a;
    event->b = b;
    event->text.fill('\0');
    std::copy_n(text.begin(), std::min(text.size(), event->text.size() - 1), event->text.begin());
    ring_.commit();
  }
  /// Housekeeping's end.
  [[nodiscard]] SpscRing<Event>& ring() noexcept { return ring_; }

 private:
  SpscRing<Event> ring_;
  Counters& counters_;
};

}  // namespace emit::server
