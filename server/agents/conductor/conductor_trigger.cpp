// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "agents/conductor/conductor.hpp"

namespace emit::server {
namespace {

/// A trigger found this many periods after it came begins no slot any more: the frame would show
/// what is long past, and hold up those behind it.
constexpr std::int64_t kStalePeriods = 4;
constexpr std::int64_t kSilencePeriods = 10;
/// Distinct warnings about triggers that nobody sealed: not for every one of a flood.
constexpr std::int64_t kWarningGapNs = 100'000'000;
/// Triggers that begin no slot, such as a source gone wild, take no more of a turn than this.
constexpr int kMostPerTurn = 64;

}  // namespace

void Conductor::poll_triggers(std::int64_t now_ns) noexcept {
  for (int taken = 0; taken < kMostPerTurn && !pending_trigger_; ++taken) {
    std::optional<ReceivedTrigger> received = triggers_->next();
    if (!received) {
      break;
    }
    // The kernel's clock and this one are read apart; a slot never begins in the future.
    received->received_ns = std::min(received->received_ns, now_ns);
    const TriggerGate::Result result = trigger_.check(received->trigger, received->received_ns);
    context_.counters.add(Counter::triggers_missing, result.missing);
    trigger_fault_ = trigger_fault_ || result.missing > 0 || result.late;
    if (result.late) {
      context_.counters.add(Counter::triggers_late);
    }
    trigger_silent_ = false;
    switch (result.verdict) {
      case TriggerGate::Verdict::duplicate:
        context_.counters.add(Counter::triggers_duplicate);
        trigger_fault_ = true;
        continue;
      case TriggerGate::Verdict::too_fast:
        context_.counters.add(Counter::triggers_too_fast);
        trigger_fault_ = true;
        continue;
      case TriggerGate::Verdict::use:
        break;
    }
    if (now_ns - received->received_ns > kStalePeriods * trigger_.period_ns()) {
      context_.counters.add(Counter::slots_missed);
      context_.conductor_events.push(EventKind::slots_missed, 1);
      trigger_fault_ = true;
      continue;
    }
    pending_trigger_ = received;
  }
  const std::string_view stranger = triggers_->take_unauthenticated();
  if (!stranger.empty() && now_ns - stranger_told_ns_ >= kWarningGapNs) {
    stranger_told_ns_ = now_ns;
    context_.conductor_events.push(
        EventKind::peer_refused, static_cast<std::uint64_t>(PeerRefusal::trigger_mac), 0, stranger);
  }
  watch_silence(now_ns);
}

bool Conductor::begin_triggered_slot() noexcept {
  // The slot before ends first, in order of time with the images that belong to it.
  if (!pending_trigger_ || trigger_.is_open()) {
    return false;
  }
  trigger_.open(pending_trigger_->trigger.number, pending_trigger_->received_ns);
  pending_trigger_.reset();
  context_.counters.add(Counter::triggers_used);
  begin_slot();
  return true;
}

void Conductor::watch_silence(std::int64_t now_ns) noexcept {
  if (!trigger_.started() || trigger_silent_ ||
      now_ns - trigger_.received_ns() < kSilencePeriods * trigger_.period_ns()) {
    return;
  }
  trigger_silent_ = true;
  trigger_fault_ = true;
  context_.counters.add(Counter::trigger_silences);
  context_.conductor_events.push(EventKind::trigger_silent, trigger_.number());
}

std::int64_t Conductor::trigger_wake_at_ns() const noexcept {
  if (draining_.load(std::memory_order_relaxed)) {
    return kNeverNs;
  }
  const std::int64_t silent_ns =
      trigger_.started() && !trigger_silent_
          ? trigger_.received_ns() + kSilencePeriods * trigger_.period_ns()
          : kNeverNs;
  return std::min(slot_end_ns(), silent_ns);
}

}  // namespace emit::server
