// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"

/// Suites of `emit bench` that measure the way of frames from the renderer to clients. Each is one
/// file of this folder.
namespace emit::tool {

void add_bench_isolation(CommandLine& bench);
void add_bench_output(CommandLine& bench);
void add_bench_stream(CommandLine& bench);

}  // namespace emit::tool
