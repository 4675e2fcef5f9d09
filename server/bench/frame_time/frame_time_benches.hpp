// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"

/// Suites of `emit bench` that measure how long frames take. Each is one file of this folder.
namespace emit::tool {

void add_bench_budget(CommandLine& bench);
void add_bench_clutter(CommandLine& bench);
void add_bench_crowd(CommandLine& bench);
void add_bench_gas(CommandLine& bench);
void add_bench_live(CommandLine& bench);
void add_bench_paper(CommandLine& bench);
void add_bench_scaling(CommandLine& bench);
void add_bench_turn(CommandLine& bench);

}  // namespace emit::tool
