// SPDX-License-Identifier: Apache-2.0
#include "net/fault_injector.hpp"

#include <algorithm>
#include <utility>

namespace emit::server {

FaultInjector::FaultInjector(const NetworkFaults& faults) : faults_(faults), random_(faults.seed) {}

/// A two-state chain: in the bad state everything is lost, in the good one nothing. It leaves the
/// bad state with 1 / burst_mean and enters it so that loss_frac of the datagrams meet it.
bool FaultInjector::loses() {
  if (faults_.burst_mean <= 1.0) {
    return chance() < faults_.loss_frac;
  }
  const double leave = 1.0 / faults_.burst_mean;
  const double enter = faults_.loss_frac >= 1.0
                           ? 1.0
                           : std::min(1.0, leave * faults_.loss_frac / (1.0 - faults_.loss_frac));
  bad_ = bad_ ? chance() >= leave : chance() < enter;
  return bad_;
}

void FaultInjector::push(std::span<const std::byte> datagram, std::int64_t now_ns) {
  ++counts_.taken;
  if (loses()) {
    ++counts_.lost;
    return;
  }
  std::vector<std::byte> bytes(datagram.begin(), datagram.end());
  if (!bytes.empty() && chance() < faults_.corrupt_frac) {
    const auto at = std::uniform_int_distribution<std::size_t>(0, bytes.size() * 8 - 1)(random_);
    bytes[at / 8] ^= std::byte{1} << (at % 8);
    ++counts_.corrupted;
  }
  if (chance() < faults_.duplicate_frac) {
    ++counts_.duplicated;
    schedule(bytes, now_ns);
  }
  schedule(std::move(bytes), now_ns);
}

void FaultInjector::schedule(std::vector<std::byte> bytes, std::int64_t now_ns) {
  std::int64_t due_ns = now_ns;
  if (faults_.jitter_ns > 0) {
    due_ns += std::uniform_int_distribution<std::int64_t>(0, faults_.jitter_ns)(random_);
  }
  if (chance() < faults_.reorder_frac) {
    due_ns += faults_.reorder_ns;
    ++counts_.held_back;
  }
  waiting_.push({due_ns, order_++, std::move(bytes)});
}

std::optional<std::vector<std::byte>> FaultInjector::pop(std::int64_t now_ns) {
  if (waiting_.empty() || waiting_.top().due_ns > now_ns) {
    return std::nullopt;
  }
  // top() is const, and what leaves is about to be popped.
  std::vector<std::byte> bytes = std::move(const_cast<Waiting&>(waiting_.top()).bytes);
  waiting_.pop();
  ++counts_.given;
  return bytes;
}

std::optional<std::int64_t> FaultInjector::due_ns() const {
  if (waiting_.empty()) {
    return std::nullopt;
  }
  return waiting_.top().due_ns;
}

}  // namespace emit::server
