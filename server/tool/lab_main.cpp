// SPDX-License-Identifier: Apache-2.0
#include "tool/commands/commands.hpp"
#include "tool/lab/lab.hpp"

/// The program emit-lab: `emit` with every command in it. `emit` runs it for those of LabCommands.
int main(int argc, char** argv) {
  using namespace emit::tool;
  return run_tool(argc, argv,
                  {.evaluate = add_evaluate,
                   .fit = add_fit,
                   .materials = add_materials,
                   .bench = add_bench,
                   .completion = add_completion,
                   .man = add_man});
}
