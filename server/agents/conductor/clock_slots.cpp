// SPDX-License-Identifier: Apache-2.0
#include "agents/conductor/clock_slots.hpp"

namespace emit::server {

void ClockSlots::start(std::int64_t now_ns) noexcept {
  clock_.start(now_ns);
  started_ = true;
  set_slot();
}

void ClockSlots::set_slot() noexcept {
  slot_.number = clock_.slot();
  slot_.begin_ns = clock_.begin_ns();
  slot_.deadline_ns = clock_.end_ns();
  end_ns_ = clock_.end_ns();
}

void ClockSlots::poll(std::int64_t now_ns) noexcept {
  if (started_ && clock_.must_restart(now_ns)) {
    start(now_ns);
    context_.conductor_events.push(EventKind::slots_missed, 0);
  }
}

bool ClockSlots::begin(std::int64_t now_ns) noexcept {
  if (started_) {
    return false;
  }
  start(now_ns);
  return true;
}

bool ClockSlots::end(std::int64_t now_ns) noexcept {
  const std::uint64_t missed = clock_.advance(now_ns);
  set_slot();
  if (missed > 0) {
    context_.counters.add(Counter::slots_missed, missed);
    context_.conductor_events.push(EventKind::slots_missed, missed);
  }
  return true;
}

}  // namespace emit::server
