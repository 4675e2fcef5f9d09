// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"

/// Commands of the program emit-lab: benchmarks, checks and fits of models, and the two that
/// describe all commands. They need the benchmarks and the solvers that other commands do without,
/// and take a quarter of the time of a build. `emit` runs them by that program, which is to lie
/// beside it.
namespace emit::tool {

inline const CommandText kBenchText{.name = "bench",
                                    .text = "Benchmarks; results as JSON",
                                    .example = "emit bench paper --json paper.json"};
inline const CommandText kCompletionText{
    .name = "completion",
    .text = "Print the completion script of a shell, to be sourced",
    .example = "source <(emit completion bash)"};
inline const CommandText kEvaluateText{
    .name = "evaluate",
    .text = "Run one model on a table; CSV to standard output",
    .example = "emit evaluate equilibrium quartic_roots.csv --precision float32 --device gpu"};
inline const CommandText kFitText{
    .name = "fit",
    .text = "Fit a material's modes to the reference solver, or to a curve",
    .example =
        "emit fit block-on-road --material asphalt --modes 4 --json fit.json --out "
        "library.toml"};
inline const CommandText kMaterialsText{
    .name = "materials",
    .text = "List, compare, plot and check the materials of a library",
    .example = "emit materials lawn sand_wet --plot lawn.svg"};
inline const CommandText kManText{
    .name = "man",
    .text = "Print the manual page of a command, for man -l; or write all pages",
    .example = "emit man render | man -l -"};

/// Functions that add these commands to a program.
struct LabCommands {
  void (*evaluate)(CommandLine& tool);
  void (*fit)(CommandLine& tool);
  void (*materials)(CommandLine& tool);
  void (*bench)(CommandLine& tool);
  void (*completion)(CommandLine& tool);
  void (*man)(CommandLine& tool);
};

/// Returns functions that add commands which run emit-lab with the same arguments.
[[nodiscard]] LabCommands forwarded_lab_commands();

}  // namespace emit::tool
