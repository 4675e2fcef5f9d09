// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"

/// Suite of `emit bench` that compares with what was measured outdoors.
namespace emit::tool {

void add_bench_nature(CommandLine& bench);

}  // namespace emit::tool
