// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"

namespace emit::tool {

/// Registers the command `terrain` in the group `scene`.
void add_terrain(CommandLine& scene);

}  // namespace emit::tool
