// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "gl/objects.hpp"

namespace emit::renderer {

/// Persistently mapped buffers that the device copies finished frames into. Each slot goes
/// free -> in flight -> free; release() is the only call allowed on another thread.
class ReadbackRing {
 public:
  static constexpr std::uint32_t kMaxSlots = 16;

  ReadbackRing(std::uint32_t slots, std::size_t bytes_per_slot);
  ~ReadbackRing();
  ReadbackRing(const ReadbackRing&) = delete;
  ReadbackRing& operator=(const ReadbackRing&) = delete;

  /// A free slot, taken; -1 when all are in use.
  [[nodiscard]] int acquire() noexcept;
  struct Range {
    std::size_t offset_bytes = 0;
    std::size_t bytes = 0;
  };
  /// Issues the copy of parts of `source` to their place in the slot, and a fence behind it.
  void copy_from(const gl::Buffer& source, std::uint32_t slot,
                 std::span<const Range> parts) noexcept;
  [[nodiscard]] bool ready(std::uint32_t slot) noexcept;
  /// Waits for the fence; false when the driver failed or hangs for ten minutes.
  [[nodiscard]] bool wait(std::uint32_t slot) noexcept;
  void release(std::uint32_t slot) noexcept;

  [[nodiscard]] const std::byte* data(std::uint32_t slot) const noexcept {
    return slots_[slot].mapped;
  }
  [[nodiscard]] std::uint32_t slot_count() const noexcept { return count_; }
  [[nodiscard]] bool mapped() const noexcept;

 private:
  struct Slot {
    gl::Buffer buffer;
    const std::byte* mapped = nullptr;
    GLsync fence = nullptr;
    std::atomic<bool> used{false};
  };
  std::array<Slot, kMaxSlots> slots_;
  std::uint32_t count_ = 0;
  std::uint32_t next_ = 0;
};

}  // namespace emit::renderer
