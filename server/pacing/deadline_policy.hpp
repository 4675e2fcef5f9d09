// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

namespace emit::server {

/// host-step: frame k is always sent for pose k; trigger: a frame may come between two slots. Late
/// when its pixels came after the deadline.
[[nodiscard]] inline bool is_past_deadline(std::int64_t deadline_ns,
                                           std::int64_t done_ns) noexcept {
  return deadline_ns != 0 && done_ns > deadline_ns;
}

/// ig-clock and trigger: what goes out in each slot. One frame is in work at a time; it goes out in
/// the slot in which it finishes, late when that is not the slot it was made for. A slot that ends
/// without a frame repeats the previous one. So every slot after the first image carries exactly
/// one frame. Pure. RT-safe.
class SlotPolicy {
 public:
  enum class SlotEnd : std::uint8_t {
    nothing,   ///< the slot has its frame already, or frames are stopped
    repeat,    ///< send the previous frame again, flagged repeated
    no_image,  ///< there is no previous frame yet
  };

  /// A slot begins; `wanted`: frames are to go out in it.
  void begin(std::uint64_t slot, bool wanted) noexcept {
    slot_ = slot;
    filled_ = !wanted;
  }
  /// True when a frame may be issued for this slot.
  [[nodiscard]] bool may_issue() const noexcept { return !in_work_ && !filled_; }
  void issued() noexcept {
    in_work_ = true;
    issued_slot_ = slot_;
  }
  /// A frame came back; it goes out now. Returns whether it is late.
  [[nodiscard]] bool finished() noexcept {
    in_work_ = false;
    filled_ = true;
    has_image_ = true;
    return issued_slot_ != slot_;
  }
  [[nodiscard]] SlotEnd end() noexcept {
    if (filled_) {
      return SlotEnd::nothing;
    }
    filled_ = true;
    return has_image_ ? SlotEnd::repeat : SlotEnd::no_image;
  }

  /// A new run: images of the old one are never repeated.
  void reset() noexcept {
    in_work_ = false;
    has_image_ = false;
  }

 private:
  std::uint64_t slot_ = 0;
  std::uint64_t issued_slot_ = 0;
  bool filled_ = true;
  bool in_work_ = false;
  bool has_image_ = false;
};

}  // namespace emit::server
