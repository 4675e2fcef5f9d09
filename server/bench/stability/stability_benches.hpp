// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"

/// The suite of `emit bench` that runs shader functions and whole frames under hostile input.
namespace emit::tool {

void add_bench_stability(CommandLine& bench);

}  // namespace emit::tool
