// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <queue>
#include <random>
#include <span>
#include <vector>

namespace emit::server {

/// Faults of a network. Fractions are 0..1 and apply to each datagram by itself unless stated.
struct NetworkFaults {
  std::uint64_t seed = 1;
  double loss_frac = 0.0;
  /// Mean number of losses in a row, by a Gilbert-Elliott chain: 1 = independent losses. loss_frac
  /// stays the share that is lost.
  double burst_mean = 1.0;
  double duplicate_frac = 0.0;
  double reorder_frac = 0.0;          ///< held back for reorder_ns
  std::int64_t reorder_ns = 200'000;  ///< overtaken by what comes meanwhile
  std::int64_t jitter_ns = 0;         ///< every datagram is delayed by 0..this, and overtakes
  double corrupt_frac = 0.0;          ///< one bit turned over; the checksum of UDP is made anew
};

/// Does that to datagrams, the same for the same seed and the same datagrams at the same times. The
/// caller says what time it is and moves the datagrams. One owner; allocates.
class FaultInjector {
 public:
  explicit FaultInjector(const NetworkFaults& faults);

  /// A datagram enters the network.
  void push(std::span<const std::byte> datagram, std::int64_t now_ns);
  /// The next one that is due, earliest first; nothing: none is, see due_ns().
  [[nodiscard]] std::optional<std::vector<std::byte>> pop(std::int64_t now_ns);
  /// When the next one is due.
  [[nodiscard]] std::optional<std::int64_t> due_ns() const;

  struct Counts {
    std::uint64_t taken = 0;
    std::uint64_t lost = 0;
    std::uint64_t duplicated = 0;
    std::uint64_t held_back = 0;
    std::uint64_t corrupted = 0;
    std::uint64_t given = 0;
  };
  [[nodiscard]] const Counts& counts() const noexcept { return counts_; }

 private:
  struct Waiting {
    std::int64_t due_ns = 0;
    std::uint64_t order = 0;  // of equal instants
    std::vector<std::byte> bytes;
  };
  struct Later {
    bool operator()(const Waiting& a, const Waiting& b) const noexcept {
      return a.due_ns != b.due_ns ? a.due_ns > b.due_ns : a.order > b.order;
    }
  };
  [[nodiscard]] double chance() { return std::uniform_real_distribution<double>()(random_); }
  [[nodiscard]] bool loses();
  void schedule(std::vector<std::byte> bytes, std::int64_t now_ns);

  NetworkFaults faults_;
  std::mt19937_64 random_;
  bool bad_ = false;  // state of the chain: in a burst of losses
  std::uint64_t order_ = 0;
  std::priority_queue<Waiting, std::vector<Waiting>, Later> waiting_;
  Counts counts_;
};

}  // namespace emit::server
