// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "io/client.hpp"

namespace emit::server {

/// What a client counts by the headers of its frames, whatever they came through. One owner.
class FrameAccount {
 public:
  /// Frames in the order in which they are handed out.
  void take(const protocol::FrameHeader& header) noexcept {
    counters.late += (header.flags & protocol::kFlagLate) != 0 ? 1 : 0;
    counters.repeated += (header.flags & protocol::kFlagRepeated) != 0 ? 1 : 0;
    const bool gap = (header.flags & protocol::kFlagGapBefore) != 0;
    counters.gaps += gap ? 1 : 0;
    if (any_ && header.run_id == run_id_ && header.frame_number > last_frame_number_ + 1) {
      (gap ? counters.skipped : counters.lost) += header.frame_number - last_frame_number_ - 1;
    }
    any_ = true;
    run_id_ = header.run_id;
    last_frame_number_ = header.frame_number;
  }
  /// A frame whose number went with its header: the gap to the next one is this frame.
  void take_unknown() noexcept { ++last_frame_number_; }

  ReceiveCounters counters;

 private:
  std::uint64_t run_id_ = 0;
  std::uint64_t last_frame_number_ = 0;
  bool any_ = false;
};

}  // namespace emit::server
