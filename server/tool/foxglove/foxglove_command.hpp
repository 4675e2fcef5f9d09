// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"

namespace emit::tool {

/// Adds `emit log export foxglove`.
/// @param exports  group of `emit log export`
void add_log_export_foxglove(CommandLine& exports);

}  // namespace emit::tool
