// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstdint>

#include "emit/protocol/trigger.hpp"

namespace emit::server {

/// Decides which triggers begin a slot, and holds the slot under way: from the kernel's receive
/// stamp to its deadline or the next trigger. Pure: the caller says when a trigger came. RT-safe.
class TriggerGate {
 public:
  /// @param rate_hz    what the source is set to; > 0. Triggers half a period or less behind the
  ///                   last one are refused, those more than half a period late are flagged.
  /// @param budget_ns  deadline behind the trigger; 0, or longer than a period: one period.
  TriggerGate(double rate_hz, std::int64_t budget_ns) noexcept
      : period_ns_(static_cast<std::int64_t>(1e9 / rate_hz)),
        budget_ns_(budget_ns > 0 ? std::min(budget_ns, period_ns_) : period_ns_) {}

  enum class Verdict : std::uint8_t { use, duplicate, too_fast };
  struct Result {
    Verdict verdict = Verdict::use;
    std::uint64_t missing = 0;  ///< numbers skipped since the last one
    bool late = false;
  };

  /// Call once per sound trigger, in order of arrival.
  [[nodiscard]] Result check(const protocol::Trigger& trigger, std::int64_t received_ns) noexcept {
    const bool same_run = trigger.run_id == run_id_;
    // A run of the source that another has replaced does not come back: a delayed datagram.
    if (started_ && (same_run ? trigger.number <= number_ : trigger.run_id < run_id_)) {
      return {Verdict::duplicate, 0, false};
    }
    Result result;
    const std::int64_t half_ns = period_ns_ / 2;
    const std::int64_t since_ns = received_ns - received_ns_;
    if (started_ && same_run) {
      result.missing = trigger.number - number_ - 1;
      // The product is computed in double, because numbers may skip by any amount.
      const double due_ns =
          static_cast<double>(trigger.number - used_number_) * static_cast<double>(period_ns_);
      result.late = static_cast<double>(since_ns) - due_ns > static_cast<double>(half_ns);
    }
    if (trigger.edge_ns != 0 && received_ns - trigger.edge_ns > half_ns) result.late = true;
    // A clock set back makes the distance negative: that says nothing about the source.
    if (started_ && since_ns >= 0 && since_ns <= half_ns) result.verdict = Verdict::too_fast;
    run_id_ = trigger.run_id;
    number_ = trigger.number;
    if (result.verdict == Verdict::use) {
      used_number_ = number_;
      received_ns_ = received_ns;
    }
    started_ = true;
    return result;
  }

  /// The slot of the trigger checked last, which came at `received_ns`.
  void open(std::uint64_t number, std::int64_t received_ns) noexcept {
    ++slot_;
    open_ = true;
    slot_number_ = number;
    begin_ns_ = received_ns;
  }
  void close() noexcept { open_ = false; }

  [[nodiscard]] bool is_open() const noexcept { return open_; }
  [[nodiscard]] bool started() const noexcept { return started_; }
  [[nodiscard]] std::uint64_t slot() const noexcept { return slot_; }
  [[nodiscard]] std::uint64_t slot_number() const noexcept { return slot_number_; }
  [[nodiscard]] std::int64_t begin_ns() const noexcept { return begin_ns_; }
  [[nodiscard]] std::int64_t end_ns() const noexcept { return begin_ns_ + budget_ns_; }
  [[nodiscard]] std::int64_t period_ns() const noexcept { return period_ns_; }
  /// Arrival and number of the last trigger used.
  [[nodiscard]] std::int64_t received_ns() const noexcept { return received_ns_; }
  [[nodiscard]] std::uint64_t number() const noexcept { return number_; }

  /// Any run of the source is welcome again; the slot under way goes on.
  void forget_source() noexcept { started_ = false; }

 private:
  std::int64_t period_ns_;
  std::int64_t budget_ns_;
  bool started_ = false;
  std::uint64_t run_id_ = 0;
  std::uint64_t number_ = 0;
  std::uint64_t used_number_ = 0;  // came at received_ns_
  std::int64_t received_ns_ = 0;
  bool open_ = false;
  std::uint64_t slot_ = 0;
  std::uint64_t slot_number_ = 0;
  std::int64_t begin_ns_ = 0;
};

}  // namespace emit::server
