// SPDX-License-Identifier: Apache-2.0
// Fuzz target: one datagram between a host and the controller of a motion simulator.
#include <cmath>
#include <vector>

#include "emit/protocol/axes.hpp"
#include "fuzz/fuzz_input.hpp"

namespace {

using namespace emit;

bool sound(const protocol::AxisMotion& axis) {
  return std::abs(axis.angle_rad) <= protocol::kMaxAxisRad &&
         std::abs(axis.rate_rad_s) <= protocol::kMaxAxisRadS &&
         std::abs(axis.acceleration_rad_s2) <= protocol::kMaxAxisRadS2;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static protocol::AxesCodec codec;
  const auto bytes = fuzz::as_bytes(data, size);
  protocol::AxesCommand command;
  command.counter = 7;
  if (codec.decode(bytes, command) == protocol::AxesFault::none) {
    fuzz::require(command.count <= protocol::kMaxAxes && command.timeout_ms > 0,
                  "an accepted command is sound");
    for (std::size_t i = 0; i < command.count; ++i) {
      fuzz::require(sound(command.axes[i]), "an accepted demand is in range");
    }
    const auto wire = codec.encode(command);
    const std::vector<std::byte> again(wire.begin(), wire.end());
    protocol::AxesCommand read;
    fuzz::require(codec.decode(again, read) == protocol::AxesFault::none &&
                      read.counter == command.counter && read.count == command.count &&
                      read.mode == command.mode,
                  "an accepted command can be said again");
  } else {
    fuzz::require(command.counter == 7, "what is refused changes nothing");
  }
  protocol::AxesMonitor monitor;
  if (codec.decode(bytes, monitor) == protocol::AxesFault::none) {
    const auto wire = codec.encode(monitor);
    const std::vector<std::byte> again(wire.begin(), wire.end());
    protocol::AxesMonitor read;
    fuzz::require(codec.decode(again, read) == protocol::AxesFault::none &&
                      read.counter == monitor.counter && read.count == monitor.count,
                  "an accepted monitor can be said again");
  }
  return 0;
}
