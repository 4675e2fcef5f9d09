// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <bit>
#include <cstddef>
#include <memory>
#include <type_traits>

#include "emit/physics/check.hpp"

namespace emit::server {

inline constexpr std::size_t kCacheLineBytes = 64;

/// Bounded queue between one producing and one consuming thread. Elements are written and read in
/// place, so large ones are never copied twice.
/// Real time: RT-safe after construction.
///
///   if (T* slot = ring.claim()) { *slot = ...; ring.commit(); }      // producer
///   while (T* slot = ring.front()) { use(*slot); ring.pop(); }       // consumer
template <class T>
class SpscRing {
  static_assert(std::is_trivially_destructible_v<T>, "rings carry plain structs");

 public:
  /// Holds at least `capacity` elements (rounded up to a power of two).
  explicit SpscRing(std::size_t capacity)
      : mask_(std::bit_ceil(capacity < 2 ? std::size_t{2} : capacity) - 1),
        slots_(std::make_unique<T[]>(mask_ + 1)) {}

  [[nodiscard]] std::size_t capacity() const noexcept { return mask_ + 1; }

  // Producer.
  /// Element to fill, or nullptr when full. Claiming again without commit gives the same element.
  [[nodiscard]] T* claim() noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - cached_head_ > mask_) {
      cached_head_ = head_.load(std::memory_order_acquire);
      if (tail - cached_head_ > mask_) {
        return nullptr;
      }
    }
    return &slots_[tail & mask_];
  }
  /// Returns the next free element, like claim().
  /// @pre free() or claim() showed room
  [[nodiscard]] T& claim_reserved() noexcept {
    EMIT_DCHECK(claim() != nullptr);
    return slots_[tail_.load(std::memory_order_relaxed) & mask_];
  }
  void commit() noexcept {
    tail_.store(tail_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }
  [[nodiscard]] bool push(const T& value) noexcept {
    T* slot = claim();
    if (slot == nullptr) {
      return false;
    }
    *slot = value;
    commit();
    return true;
  }
  /// Room as the producer may rely on.
  [[nodiscard]] std::size_t free() noexcept {
    cached_head_ = head_.load(std::memory_order_acquire);
    return capacity() - (tail_.load(std::memory_order_relaxed) - cached_head_);
  }

  // Consumer.
  [[nodiscard]] T* front() noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == cached_tail_) {
      cached_tail_ = tail_.load(std::memory_order_acquire);
      if (head == cached_tail_) {
        return nullptr;
      }
    }
    return &slots_[head & mask_];
  }
  void pop() noexcept {
    head_.store(head_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }
  /// Elements as the consumer may rely on.
  [[nodiscard]] std::size_t size() noexcept {
    cached_tail_ = tail_.load(std::memory_order_acquire);
    return cached_tail_ - head_.load(std::memory_order_relaxed);
  }

 private:
  const std::size_t mask_;
  const std::unique_ptr<T[]> slots_;
  alignas(kCacheLineBytes) std::atomic<std::size_t> tail_{0};  // written by the producer
  std::size_t cached_head_ = 0;
  alignas(kCacheLineBytes) std::atomic<std::size_t> head_{0};  // written by the consumer
  std::size_t cached_tail_ = 0;
};

}  // namespace emit::server
