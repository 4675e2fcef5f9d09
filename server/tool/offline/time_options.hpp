// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"
#include "tool/command_line/command_line.hpp"

/// Options of the commands that work on several instants of a scenario.
namespace emit::tool {

/// Instants as the command line gives them.
struct TimeChoice {
  std::vector<double> times_s;  ///< of --time-s
  std::string list;             ///< of --times; empty: not given
  double utc_offset_h = 0.0;    ///< clock of the list minus UTC
  std::string command;          ///< for messages, e.g. "emit render"
};

/// Adds --time-s, --times and --utc-offset-h to `command`. `text` completes the help of --time-s.
void add_times(CommandLine& line, const std::string& command, TimeChoice& target,
               const std::string& text);

/// Returns the instants of both options in s, ascending, each once. Errors: invalid_argument,
/// naming the option.
[[nodiscard]] physics::Result<std::vector<double>> resolve_times(
    const TimeChoice& choice, const scene::ScenarioDesc& scenario);

}  // namespace emit::tool
