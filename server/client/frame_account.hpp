// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstdint>

#include "emit/client/client.hpp"

namespace emit::client {

/// Counts that a client makes from the headers of its frames, over any transport. Thread: one
/// owner.
class FrameAccount {
 public:
  /// Frames in the order in which they are handed out. `lost_before`: that were sent before this
  /// one and did not come, by their ids; where there are none, only numbers tell.
  void take(const protocol::FrameHeader& header, std::uint64_t lost_before = 0) noexcept {
    counters.late += (header.flags & protocol::kFlagLate) != 0 ? 1 : 0;
    counters.repeated += (header.flags & protocol::kFlagRepeated) != 0 ? 1 : 0;
    const bool gap = (header.flags & protocol::kFlagGapBefore) != 0;
    counters.gaps += gap ? 1 : 0;
    const std::uint64_t missing = missing_before(header);
    counters.lost += lost_before;
    (gap ? counters.skipped : counters.lost) += missing - std::min(missing, lost_before);
    any_ = true;
    run_id_ = header.run_id;
    last_frame_number_ = header.frame_number;
  }
  /// Frames that this client wanted between the one taken last and this one.
  [[nodiscard]] std::uint64_t missing_before(const protocol::FrameHeader& header) const noexcept {
    return any_ && header.run_id == run_id_ && header.frame_number > last_frame_number_
               ? (header.frame_number - last_frame_number_ - 1) / every_nth_
               : 0;
  }
  /// A frame whose number went with its header: the gap to the next one is this frame.
  void take_unknown(std::uint64_t lost_before) noexcept {
    counters.lost += lost_before;
    last_frame_number_ += (1 + lost_before) * every_nth_;
  }
  /// Before the first frame: only every n-th one is to come, the rest is not missing.
  void set_every_nth(std::uint32_t every_nth) noexcept { every_nth_ = every_nth; }

  ReceiveCounters counters;

 private:
  std::uint32_t every_nth_ = 1;
  std::uint64_t run_id_ = 0;
  std::uint64_t last_frame_number_ = 0;
  bool any_ = false;
};

}  // namespace emit::client
