// SPDX-License-Identifier: Apache-2.0
#include "tool/commands/commands.hpp"
#include "tool/lab/lab.hpp"

/// The program emit-lab: `emit` with every command in it. `emit` runs it for those of LabCommands.
int main(int argc, char** argv) {
  using namespace emit::tool;
  return run_tool(argc, argv, {add_evaluate, add_fit, add_bench, add_completion, add_man});
}
