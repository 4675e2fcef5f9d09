// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"

/// Suites of `emit bench` that compare temperatures, or the energy of targets, with a reference.
/// Each is one file of this folder.
namespace emit::tool {

void add_bench_convergence(CommandLine& bench);
void add_bench_error(CommandLine& bench);
void add_bench_subpixel(CommandLine& bench);
void add_bench_thermal_truth(CommandLine& bench);
void add_bench_uncertainty(CommandLine& bench);

}  // namespace emit::tool
