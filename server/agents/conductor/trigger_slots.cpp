// SPDX-License-Identifier: Apache-2.0
#include "agents/conductor/trigger_slots.hpp"

#include <algorithm>

namespace emit::server {
namespace {

/// Number of periods after its arrival at which a trigger is stale. It begins no slot then: its
/// frame would show a time long past, and delay the frames after it.
constexpr std::int64_t kStalePeriods = 4;
constexpr std::int64_t kSilencePeriods = 10;
/// Shortest time between two warnings of triggers without a valid MAC, so that a flood does not
/// fill the log.
constexpr std::int64_t kWarningGapNs = 100'000'000;
/// Largest number of triggers that begin no slot in one turn.
constexpr int kMaxPerTurn = 64;

}  // namespace

void TriggerSlots::poll(std::int64_t now_ns) noexcept {
  for (int taken = 0; taken < kMaxPerTurn && !pending_; ++taken) {
    std::optional<ReceivedTrigger> received = triggers_.next();
    if (!received) {
      break;
    }
    // The kernel's clock and this one are read apart; a slot never begins in the future.
    received->received_ns = std::min(received->received_ns, now_ns);
    if (use(*received, now_ns)) {
      pending_ = received;
    }
  }
  warn_of_strangers(now_ns);
  watch_silence(now_ns);
  set_end();
}

bool TriggerSlots::use(const ReceivedTrigger& received, std::int64_t now_ns) noexcept {
  const TriggerGate::Result result = gate_.check(received.trigger, received.received_ns);
  context_.counters.add(Counter::triggers_missing, result.missing);
  if (result.missing > 0 || result.late) {
    set_fault();
  }
  if (result.late) {
    context_.counters.add(Counter::triggers_late);
  }
  silent_ = false;
  switch (result.verdict) {
    case TriggerGate::Verdict::duplicate:
      context_.counters.add(Counter::triggers_duplicate);
      set_fault();
      return false;
    case TriggerGate::Verdict::too_fast:
      context_.counters.add(Counter::triggers_too_fast);
      set_fault();
      return false;
    case TriggerGate::Verdict::use:
      break;
  }
  if (now_ns - received.received_ns > kStalePeriods * gate_.period_ns()) {
    context_.counters.add(Counter::slots_missed);
    context_.conductor_events.push(EventKind::slots_missed, 1);
    set_fault();
    return false;
  }
  return true;
}

void TriggerSlots::warn_of_strangers(std::int64_t now_ns) noexcept {
  const std::string_view stranger = triggers_.take_unauthenticated();
  if (!stranger.empty() && now_ns - warned_ns_ >= kWarningGapNs) {
    warned_ns_ = now_ns;
    context_.conductor_events.push(
        EventKind::peer_refused, static_cast<std::uint64_t>(PeerRefusal::trigger_mac), 0, stranger);
  }
}

bool TriggerSlots::begin(std::int64_t /*now_ns*/) noexcept {
  // The previous slot ends first, in order of time with the images that belong to it.
  if (!pending_ || gate_.is_open()) {
    return false;
  }
  gate_.open(pending_->trigger.number, pending_->received_ns);
  pending_.reset();
  slot_ = {gate_.slot(), gate_.begin_ns(), gate_.end_ns(), gate_.slot_number()};
  set_end();
  context_.counters.add(Counter::triggers_used);
  return true;
}

bool TriggerSlots::end(std::int64_t /*now_ns*/) noexcept {
  gate_.close();
  set_end();
  return false;  // the next slot begins with its trigger
}

void TriggerSlots::set_end() noexcept {
  if (!gate_.is_open()) {
    end_ns_ = kNeverNs;
  } else {
    end_ns_ = pending_ ? std::min(gate_.end_ns(), pending_->received_ns) : gate_.end_ns();
  }
}

void TriggerSlots::watch_silence(std::int64_t now_ns) noexcept {
  if (!gate_.started() || silent_ ||
      now_ns - gate_.received_ns() < kSilencePeriods * gate_.period_ns()) {
    return;
  }
  silent_ = true;
  set_fault();
  context_.counters.add(Counter::trigger_silences);
  context_.conductor_events.push(EventKind::trigger_silent, gate_.number());
}

std::int64_t TriggerSlots::wake_at_ns() const noexcept {
  const std::int64_t silent_ns = gate_.started() && !silent_
                                     ? gate_.received_ns() + kSilencePeriods * gate_.period_ns()
                                     : kNeverNs;
  return std::min(end_ns_, silent_ns);
}

}  // namespace emit::server
