// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "emit/physics/check.hpp"
#include "gl/objects.hpp"

namespace emit::renderer {

/// Ring of persistently mapped buffers that the device copies finished frames into. A slot is free,
/// then in flight, then free again.
/// Thread: the one that owns the GL context; release() may be called on any thread. Real time: the
/// constructor is setup only; all other functions are RT-safe, and wait() blocks.
class ReadbackRing {
 public:
  static constexpr std::uint32_t kMaxSlots = 32;

  /// Ring of `slots` slots of `bytes_per_slot` bytes. mapped() says whether the driver gave the
  /// memory.
  /// @pre 1 <= slots <= kMaxSlots, bytes_per_slot >= 1
  ReadbackRing(std::uint32_t slots, std::size_t bytes_per_slot);
  ~ReadbackRing();
  ReadbackRing(const ReadbackRing&) = delete;
  ReadbackRing& operator=(const ReadbackRing&) = delete;

  /// Takes a free slot and returns its number; -1 when all slots are in use.
  [[nodiscard]] int acquire() noexcept;
  /// Part of a buffer.
  struct Range {
    std::size_t offset_bytes = 0;
    std::size_t bytes = 0;
  };
  /// Issues the copy of parts of `source` to the same offsets of the slot, and a fence behind it.
  /// @pre The slot is taken; the parts lie within both buffers.
  void copy_from(const gl::Buffer& source, std::uint32_t slot,
                 std::span<const Range> parts) noexcept;
  /// True when wait() would not block.
  /// @pre The slot is taken.
  [[nodiscard]] bool ready(std::uint32_t slot) noexcept;
  /// Waits until the copy into the slot is complete. Returns false when no copy was issued, the
  /// driver failed, or the device has not answered for ten minutes.
  /// @pre The slot is taken.
  [[nodiscard]] bool wait(std::uint32_t slot) noexcept;
  /// Makes a slot free again. Thread: any.
  /// @pre The slot is taken.
  void release(std::uint32_t slot) noexcept;

  /// Mapped memory of a slot. Its content is valid from wait() to release().
  /// @pre slot < slot_count()
  [[nodiscard]] const std::byte* data(std::uint32_t slot) const noexcept {
    EMIT_CHECK_OP(slot, <, count_);
    return slots_[slot].mapped;
  }
  [[nodiscard]] std::uint32_t slot_count() const noexcept { return count_; }
  /// False when the driver could not map the memory of some slot.
  [[nodiscard]] bool mapped() const noexcept;

 private:
  /// Checks that a slot exists and is taken.
  void check_taken(std::uint32_t slot) const noexcept;

  struct Slot {
    gl::Buffer buffer;
    const std::byte* mapped = nullptr;
    GLsync fence = nullptr;
    std::atomic<bool> used{false};
  };
  std::array<Slot, kMaxSlots> slots_;
  std::uint32_t count_ = 0;
  std::uint32_t next_ = 0;  ///< slot at which acquire() starts to search
};

}  // namespace emit::renderer
