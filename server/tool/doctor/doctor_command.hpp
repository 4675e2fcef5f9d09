// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"

namespace emit::tool {

/// `emit doctor`: what this machine lacks for emitd.
void add_doctor(CommandLine& tool);

}  // namespace emit::tool
