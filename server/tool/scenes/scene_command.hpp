// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"

namespace emit::tool {

/// Registers the commands `scene new`, `scene check`, `scene preview` and `scene terrain`, as the
/// functions of tool/commands/commands.hpp do theirs.
void add_scene(CommandLine& tool);

}  // namespace emit::tool
