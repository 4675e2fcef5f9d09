// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"

namespace emit::tool {

/// Registers the command `probe`, as the functions of tool/commands/commands.hpp do theirs.
void add_probe(CommandLine& tool);

}  // namespace emit::tool
