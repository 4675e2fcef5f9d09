// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"

/// The commands below `emit log`; log.cpp holds those that write logs and tables.
namespace emit::tool {

void add_log_info(CommandLine& log);

}  // namespace emit::tool
