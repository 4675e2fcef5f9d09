// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "agents/context.hpp"
#include "console/console_tap.hpp"
#include "telemetry/duty_cycle.hpp"
#include "telemetry/status_board.hpp"

namespace emit::server {

/// Names and settings that a page is told once. They are fixed after start.
struct ConsoleFacts {
  std::string software;
  std::string scenario;
  std::string pacing;
  std::string device;
  double rate_hz = 0.0;         ///< rate of the slots; 0: frames follow the host
  std::int64_t budget_ns = 0;   ///< host-step: time for a frame; 0: none
  double image_rate_hz = 10.0;  ///< largest rate of images
  bool motion = false;          ///< a motion simulator is driven
  std::string no_explanation;   ///< why pixels cannot be explained; empty: they can
  std::string recording;        ///< what is replayed, JSON; empty: nothing is
};

/// Returns the first message to a page, JSON.
/// @param may_command  whether this page's commands are taken
[[nodiscard]] std::string console_hello(const ConsoleFacts& facts, const Context& context,
                                        bool may_command);

/// Moments of a status.
struct ConsoleMoment {
  bool ready = false;
  std::int64_t uptime_ns = 0;
  std::size_t pages = 0;
  std::string_view replay = {};  ///< state of the replay, JSON; empty: nothing is replayed
};
/// Returns the state of the daemon, JSON, with the ticks of the frames since the last call.
[[nodiscard]] std::string console_status(Context& context, ConsoleTap& tap,
                                         const StatusBoard& board, const NamedDutyCycles& agents,
                                         const ConsoleMoment& moment);

/// Returns the radiances of a channel's temperature table (image::TemperatureTable) as bytes;
/// empty for a channel without a band or with pixels that are no radiance.
[[nodiscard]] std::string console_temperatures(const Channel& channel);

}  // namespace emit::server
