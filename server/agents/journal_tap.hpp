// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "rt/doorbell.hpp"

namespace emit::server {

/// Hands the journal of the current run, as the recorder keeps it in memory, to one asker. The
/// recorder looks at one atomic per turn while nobody asks.
/// Threads: ask() and taken() belong to the asker, is_asked(), add() and finish() to the recorder.
class JournalTap {
 public:
  /// @param recorder  bell of the recorder
  explicit JournalTap(Doorbell& recorder) : recorder_(recorder) {}

  /// Asks for the entries of the run up to now. What came before and was not taken is dropped.
  /// Returns false while the recorder answers an earlier call.
  bool ask() noexcept {
    State idle = State::idle;
    State ready = State::ready;
    if (!state_.compare_exchange_strong(idle, State::asked) &&
        !state_.compare_exchange_strong(ready, State::asked)) {
      return false;
    }
    recorder_.ring();
    return true;
  }
  /// Returns whether the recorder has answered.
  [[nodiscard]] bool is_ready() const noexcept {
    return state_.load(std::memory_order_acquire) == State::ready;
  }
  /// Takes the answer: framed control records, one behind the other.
  /// @pre is_ready()
  [[nodiscard]] std::vector<std::byte> take() noexcept {
    std::vector<std::byte> out = std::exchange(records_, {});
    state_.store(State::idle, std::memory_order_release);
    return out;
  }

  [[nodiscard]] bool is_asked() const noexcept {
    return state_.load(std::memory_order_acquire) == State::asked;
  }
  /// Makes room for the answer, in place of an earlier one. @pre is_asked()
  void begin(std::size_t bytes) {
    records_.clear();
    records_.reserve(bytes);
  }
  void add(std::span<const std::byte> record) {
    records_.insert(records_.end(), record.begin(), record.end());
  }
  void finish() noexcept { state_.store(State::ready, std::memory_order_release); }

 private:
  enum class State : std::uint8_t { idle, asked, ready };
  Doorbell& recorder_;
  std::atomic<State> state_{State::idle};
  std::vector<std::byte> records_;  ///< the recorder's while asked, else the asker's
};

}  // namespace emit::server
