// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/commands/lab_commands.hpp"

/// The commands of emit-lab, one file each, as those of `emit` in server/tool/commands.
namespace emit::tool {

void add_bench(CommandLine& tool);
void add_completion(CommandLine& tool);
void add_evaluate(CommandLine& tool);
void add_fit(CommandLine& tool);
void add_materials(CommandLine& tool);
void add_man(CommandLine& tool);

}  // namespace emit::tool
