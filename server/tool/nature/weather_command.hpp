// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"

namespace emit::tool {

/// Registers the command `weather`, as the functions of tool/commands/commands.hpp do.
void add_weather(CommandLine& tool);

}  // namespace emit::tool
