// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "agents/conductor/slot_source.hpp"
#include "pacing/ig_clock.hpp"

namespace emit::server {

/// Pacing mode ig-clock: slots of equal length follow each other from the first turn on.
class ClockSlots final : public SlotSource {
 public:
  ClockSlots(Context& context, double rate_hz)
      : SlotSource(false), context_(context), clock_(rate_hz) {}

  void poll(std::int64_t now_ns) noexcept override;
  [[nodiscard]] bool begin(std::int64_t now_ns) noexcept override;
  [[nodiscard]] bool end(std::int64_t now_ns) noexcept override;
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override { return end_ns_; }

 private:
  void start(std::int64_t now_ns) noexcept;
  void set_slot() noexcept;

  Context& context_;
  IgClock clock_;
  bool started_ = false;
};

}  // namespace emit::server
