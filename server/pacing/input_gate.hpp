// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

#include "emit/protocol/host_frame.hpp"

namespace emit::server {

enum class GateVerdict : std::uint8_t {
  accept,
  new_epoch,  ///< the host restarted: accept after a reset of the run
  time_backwards,
  duplicate_frame,
};

/// Decides on the order of host frames: what is accepted moves frame number up and sim time not
/// back. Pure. RT-safe.
class InputGate {
 public:
  struct Result {
    GateVerdict verdict = GateVerdict::accept;
    std::uint64_t missing = 0;  ///< frame numbers skipped since the last one accepted
  };

  [[nodiscard]] Result check(const protocol::HostFrameData& frame) const noexcept {
    if (!started_) {
      return {};
    }
    if (frame.run_id != run_id_) {
      return {GateVerdict::new_epoch, 0};
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
    started_ = true;
    run_id_ = frame.run_id;
    frame_number_ = frame.frame_number;
    sim_time_ns_ = frame.sim_time_ns;
  }

  void reset() noexcept { started_ = false; }

 private:
  bool started_ = false;
  std::uint64_t run_id_ = 0;
  std::uint64_t frame_number_ = 0;
  std::int64_t sim_time_ns_ = 0;
};

}  // namespace emit::server
