// SPDX-License-Identifier: Apache-2.0
#include "client/resend_planner.hpp"

#include <algorithm>

namespace emit::client {

ResendPlanner::Step ResendPlanner::next(std::span<const protocol::Reassembler::OpenFrame> frames,
                                        std::int64_t now_ns) noexcept {
  frames = frames.first(std::min(frames.size(), kMaxFrames));
  for (Watched& each : watched_) {
    each.used = each.used && std::ranges::any_of(frames, [&](const auto& frame) {
                  return frame.frame_id == each.frame_id;
                });
  }
  Step step;
  for (const auto& frame : frames) {
    auto known = std::ranges::find_if(watched_, [&](const Watched& each) {
      return each.used && each.frame_id == frame.frame_id;
    });
    if (known == watched_.end()) {
      known = std::ranges::find_if(watched_, [](const Watched& each) { return !each.used; });
      *known = {true, frame.frame_id, frame.arrivals, now_ns, 0, 0};
    } else if (known->arrivals != frame.arrivals) {
      known->arrivals = frame.arrivals;
      known->changed_ns = now_ns;
      known->asked = 0;
    }
    std::int64_t due_ns =
        known->changed_ns + (frame.end_seen ? params_.settle_ns : params_.quiet_ns);
    if (known->asked_ns != 0) {
      due_ns = std::max(due_ns, known->asked_ns + params_.answer_ns);
    }
    if (now_ns < due_ns) {
      step.wake_ns = step.wake_ns == 0 ? due_ns : std::min(step.wake_ns, due_ns);
      continue;
    }
    if (known->asked == params_.requests) {
      return {Step::Kind::give_up, frame.frame_id, 0, false};
    }
    const bool tail = frame.end_seen || known->asked > 0;
    ++known->asked;
    known->asked_ns = now_ns;
    return {Step::Kind::ask, frame.frame_id, 0, tail};
  }
  return step;
}

}  // namespace emit::client
