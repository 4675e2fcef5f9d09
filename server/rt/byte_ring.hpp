// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>

#include "rt/spsc_ring.hpp"

namespace emit::server {

/// Ring like SpscRing for records of any length: a journal line takes the room that it needs, not
/// that of the largest one. Records are contiguous and aligned to 16 bytes.
///
/// Real time: RT-safe after construction.
class ByteRing {
 public:
  explicit ByteRing(std::size_t capacity_bytes)
      : mask_(std::bit_ceil(capacity_bytes < 4096 ? std::size_t{4096} : capacity_bytes) - 1),
        memory_(std::make_unique<Block[]>((mask_ + 1) / sizeof(Block))) {}

  [[nodiscard]] std::size_t capacity_bytes() const noexcept { return mask_ + 1; }

  /// Memory for one record, empty when there is no room. Follow with commit().
  [[nodiscard]] std::span<std::byte> claim(std::size_t bytes) noexcept {
    const std::size_t need = record_bytes(bytes);
    std::size_t tail = tail_.load(std::memory_order_relaxed);
    const std::size_t to_end = capacity_bytes() - (tail & mask_);
    const std::size_t padding = need > to_end ? to_end : 0;
    if (need > capacity_bytes() || tail + padding + need - cached_head_ > capacity_bytes()) {
      cached_head_ = head_.load(std::memory_order_acquire);
      if (need > capacity_bytes() || tail + padding + need - cached_head_ > capacity_bytes()) {
        return {};
      }
    }
    if (padding != 0) {
      write_length(tail, kPadding);
      tail += padding;
    }
    write_length(tail, bytes);
    claimed_end_ = tail + need;
    return {at(tail) + sizeof(Block), bytes};
  }
  void commit() noexcept { tail_.store(claimed_end_, std::memory_order_release); }

  /// Oldest record, or empty. Follow with pop().
  [[nodiscard]] std::span<const std::byte> front() noexcept {
    for (;;) {
      const std::size_t head = head_.load(std::memory_order_relaxed);
      if (head == tail_.load(std::memory_order_acquire)) {
        return {};
      }
      const std::uint64_t length = read_length(head);
      if (length == kPadding) {
        head_.store(head + capacity_bytes() - (head & mask_), std::memory_order_release);
        continue;
      }
      front_end_ = head + record_bytes(static_cast<std::size_t>(length));
      return {at(head) + sizeof(Block), static_cast<std::size_t>(length)};
    }
  }
  void pop() noexcept { head_.store(front_end_, std::memory_order_release); }

 private:
  struct alignas(16) Block {
    std::byte bytes[16];
  };
  static constexpr std::uint64_t kPadding = ~std::uint64_t{0};

  static constexpr std::size_t record_bytes(std::size_t payload) noexcept {
    return sizeof(Block) + (payload + sizeof(Block) - 1) / sizeof(Block) * sizeof(Block);
  }
  [[nodiscard]] std::byte* at(std::size_t position) const noexcept {
    return memory_[(position & mask_) / sizeof(Block)].bytes;
  }
  void write_length(std::size_t position, std::uint64_t length) noexcept {
    std::memcpy(at(position), &length, sizeof(length));
  }
  [[nodiscard]] std::uint64_t read_length(std::size_t position) const noexcept {
    std::uint64_t length = 0;
    std::memcpy(&length, at(position), sizeof(length));
    return length;
  }

  const std::size_t mask_;
  const std::unique_ptr<Block[]> memory_;
  alignas(kCacheLineBytes) std::atomic<std::size_t> tail_{0};
  std::size_t claimed_end_ = 0;
  std::size_t cached_head_ = 0;
  alignas(kCacheLineBytes) std::atomic<std::size_t> head_{0};
  std::size_t front_end_ = 0;
};

}  // namespace emit::server
