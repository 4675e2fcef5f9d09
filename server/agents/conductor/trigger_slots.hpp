// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>

#include "agents/conductor/slot_source.hpp"
#include "pacing/trigger_gate.hpp"

namespace emit::server {

/// Pacing mode trigger: a trigger datagram begins a slot, its deadline or the next trigger ends it.
class TriggerSlots final : public SlotSource {
 public:
  TriggerSlots(Context& context, const config::PacingConfig& pacing, TriggerInput& triggers)
      : SlotSource(true),
        context_(context),
        triggers_(triggers),
        gate_(pacing.rate_hz, pacing.budget_ns) {}

  void poll(std::int64_t now_ns) noexcept override;
  [[nodiscard]] bool begin(std::int64_t now_ns) noexcept override;
  [[nodiscard]] bool end(std::int64_t now_ns) noexcept override;
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override;
  [[nodiscard]] int fd() const noexcept override { return triggers_.fd(); }
  void reset() noexcept override { gate_.forget_source(); }

 private:
  /// Takes a trigger, and counts and flags its faults. Returns false for a trigger that begins no
  /// slot.
  [[nodiscard]] bool use(const ReceivedTrigger& received, std::int64_t now_ns) noexcept;
  void warn_of_strangers(std::int64_t now_ns) noexcept;
  void watch_silence(std::int64_t now_ns) noexcept;
  void set_fault() noexcept { flags_ |= protocol::kFlagTriggerFault; }
  void set_end() noexcept;

  Context& context_;
  TriggerInput& triggers_;
  TriggerGate gate_;
  std::optional<ReceivedTrigger> pending_;  // passed the gate; its slot has not begun
  std::int64_t warned_ns_ = 0;              // last warning of triggers without a MAC
  bool silent_ = false;
};

}  // namespace emit::server
