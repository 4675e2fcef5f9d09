// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/frames.hpp"
#include "emit/protocol/frame_header.hpp"
#include "tool/engage/flight_host.hpp"
#include "tool/engage/seeker_process.hpp"

namespace emit::tool {

/// One frame of the closed loop, as the host saw it.
struct LoopFrame {
  double time_s = 0.0;  ///< of the pose since the begin of the flight
  physics::Pose host_pose;
  FlightTruth truth;
  std::optional<glm::dvec3> target_m;  ///< true place at that time
  std::optional<SeekerAnswer> answer;
  physics::Pose frame_pose;         ///< of the header; in real time that of the projector
  double measured_error_rad = NAN;  ///< direction measured against the true one; NaN: none measured
  double loop_delay_ms = NAN;       ///< wall time from the pose sent to the answer read
  std::uint32_t flags = 0;          ///< FrameFlags of the header
  protocol::MotionState motion_state = protocol::MotionState::none;
  double pointing_error_px = NAN;  ///< of the header; NaN: not known
};

/// A picture of the film strip.
struct FilmPicture {
  double time_s = 0.0;
  double range_m = 0.0;
  std::string file;  ///< PNG in the folder of the report
  std::uint64_t frame_number = 0;
  std::optional<SeekerAnswer> answer;
};

/// Record of a closed loop.
struct LoopRecord {
  std::vector<LoopFrame> frames;
  std::vector<FilmPicture> film;
  std::uint64_t poses = 0;
  std::uint64_t answers = 0;            ///< of the seeker
  std::uint64_t unmatched_answers = 0;  ///< real time: to frames that the host did not see
  double wall_s = 0.0;
  bool ended = false;  ///< by the host; false: the time was up
};

}  // namespace emit::tool
