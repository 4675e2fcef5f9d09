// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "tool/doctor/machine_facts.hpp"

namespace emit::tool {

enum class Severity : std::uint8_t {
  pass,
  warn,  ///< emitd runs, with more jitter or less speed
  fail,  ///< emitd does not run, or what was asked for is refused
};

/// One thing that emitd depends on.
struct Finding {
  Severity severity = Severity::pass;
  std::string item;
  std::string found;
  std::string remedy;  ///< command or setting that mends it; empty with `pass`
};

/// The machine is to serve for this.
struct DoctorNeeds {
  unsigned int frame_mib = 2;  ///< size of a frame, for the buffers of sockets
  /// The profile low_latency: limits that it would be refused, and instants that would be wrong,
  /// are failures.
  bool real_time = false;
};

/// Judges a machine. Any thread.
[[nodiscard]] std::vector<Finding> findings_of(const MachineFacts& facts, const DoctorNeeds& needs);

}  // namespace emit::tool
