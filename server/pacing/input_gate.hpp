// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "emit/protocol/host_frame.hpp"

namespace emit::server {

enum class GateVerdict : std::uint8_t {
  accept,
  new_epoch,  ///< the host restarted: accept after a reset of the run
  time_backwards,
  duplicate_frame,
  old_run,  ///< of a run that another one has replaced: a packet that was delayed
};

/// Decides on the order of host frames: what is accepted moves frame number up and sim time not
/// back, and a run once replaced does not come back. Pure. RT-safe.
class InputGate {
 public:
  /// Replaced runs that are remembered; a host that restarts more often outlives its packets.
  static constexpr std::size_t kReplacedRuns = 8;

  struct Result {
    GateVerdict verdict = GateVerdict::accept;
    std::uint64_t missing = 0;  ///< frame numbers skipped since the last one accepted
  };

  [[nodiscard]] Result check(const protocol::HostFrameData& frame) const noexcept {
    if (!started_) {
      return {};
    }
    if (frame.run_id != run_id_) {
      const auto end = replaced_.begin() + static_cast<std::ptrdiff_t>(replaced_count_);
      const bool known = std::find(replaced_.begin(), end, frame.run_id) != end;
      return {known ? GateVerdict::old_run : GateVerdict::new_epoch, 0};
    }
    // Time first: an old frame that overtook is "backwards", the same frame twice a duplicate.
    if (frame.frame_number == frame_number_) {
      return {GateVerdict::duplicate_frame, 0};
    }
    if (frame.sim_time_ns < sim_time_ns_) {
      return {GateVerdict::time_backwards, 0};
    }
    if (frame.frame_number < frame_number_) {
      return {GateVerdict::duplicate_frame, 0};
    }
    return {GateVerdict::accept, frame.frame_number - frame_number_ - 1};
  }

  void accept(const protocol::HostFrameData& frame) noexcept {
    if (started_ && frame.run_id != run_id_) {
      replaced_[next_replaced_] = run_id_;
      next_replaced_ = (next_replaced_ + 1) % kReplacedRuns;
      replaced_count_ = std::min(replaced_count_ + 1, kReplacedRuns);
    }
    started_ = true;
    run_id_ = frame.run_id;
    frame_number_ = frame.frame_number;
    sim_time_ns_ = frame.sim_time_ns;
  }

  /// The host asked for a reset: any run is welcome again.
  void reset() noexcept { *this = InputGate{}; }

 private:
  bool started_ = false;
  std::uint64_t run_id_ = 0;
  std::uint64_t frame_number_ = 0;
  std::int64_t sim_time_ns_ = 0;
  std::array<std::uint64_t, kReplacedRuns> replaced_{};  // ring
  std::size_t next_replaced_ = 0;
  std::size_t replaced_count_ = 0;
};

}  // namespace emit::server
