// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <utility>

#include "agents/agent.hpp"
#include "agents/context.hpp"
#include "emit/config/daemon_config.hpp"
#include "net/trigger_port.hpp"

namespace emit::server {

/// Strategy of a pacing mode whose frames belong to slots, not to poses. It decides when a slot
/// begins and ends. Mode host-step has no slots and no such object.
///
/// The virtual functions are called once a turn of the conductor or once a slot; what a frame needs
/// is read from members. Thread: the conductor's. Real time: RT-safe after construction.
class SlotSource {
 public:
  /// The slot under way, or the last one.
  struct Slot {
    std::uint64_t number = 0;
    std::int64_t begin_ns = 0;         ///< wall
    std::int64_t deadline_ns = 0;      ///< when the slot's frame is due, wall
    std::uint64_t trigger_number = 0;  ///< trigger: the trigger that began it; else 0
  };

  SlotSource(const SlotSource&) = delete;
  SlotSource& operator=(const SlotSource&) = delete;
  virtual ~SlotSource() = default;

  /// Takes inputs from outside since the last turn, such as triggers.
  virtual void poll(std::int64_t now_ns) noexcept = 0;
  /// Begins a slot that does not follow the end of another one. Returns false when there is none to
  /// begin now.
  [[nodiscard]] virtual bool begin(std::int64_t now_ns) noexcept = 0;
  /// Ends the slot under way. Returns true when the next one has begun with it.
  [[nodiscard]] virtual bool end(std::int64_t now_ns) noexcept = 0;
  /// Returns the instant at which the conductor must turn again, wall; kNeverNs: none.
  [[nodiscard]] virtual std::int64_t wake_at_ns() const noexcept = 0;
  /// Returns the descriptor that becomes readable when poll() may find something; -1: none.
  [[nodiscard]] virtual int fd() const noexcept { return -1; }
  /// Resets the strategy after the host has reset the run.
  virtual void reset() noexcept {}

  [[nodiscard]] const Slot& slot() const noexcept { return slot_; }
  /// Returns the end of the slot under way as far as it is known now, wall; kNeverNs: there is no
  /// slot.
  [[nodiscard]] std::int64_t end_ns() const noexcept { return end_ns_; }
  /// Returns true when a frame after its deadline counts as late, even within its slot.
  [[nodiscard]] bool has_deadlines() const noexcept { return has_deadlines_; }
  /// Returns the flags that the next frame carries because of faults since the last call.
  [[nodiscard]] std::uint32_t take_flags() noexcept { return std::exchange(flags_, 0U); }

 protected:
  explicit SlotSource(bool has_deadlines) : has_deadlines_(has_deadlines) {}
  Slot slot_;
  std::int64_t end_ns_ = kNeverNs;
  std::uint32_t flags_ = 0;

 private:
  bool has_deadlines_ = false;
};

/// Makes the strategy of a pacing mode; null for host-step.
/// @param triggers  where mode trigger reads its triggers; that mode needs it
[[nodiscard]] std::unique_ptr<SlotSource> make_slot_source(Context& context,
                                                           const config::PacingConfig& pacing,
                                                           TriggerInput* triggers);

}  // namespace emit::server
