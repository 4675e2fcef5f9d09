// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"
#include "tool/commands/lab_commands.hpp"

/// The subcommands of `emit`. Each is one file of this folder, which holds its options, how they
/// are declared and what runs. Its functions return the exit code of the process; they print
/// results to standard output and everything else to standard error.
namespace emit::tool {

void add_compare(CommandLine& tool);
void add_demo(CommandLine& tool);
void add_export(CommandLine& tool);
void add_fms_sim(CommandLine& tool);
void add_generate(CommandLine& tool);
void add_inspect(CommandLine& tool);
void add_latency(CommandLine& tool);
void add_log(CommandLine& tool);
void add_make_log(CommandLine& tool);
void add_receive(CommandLine& tool);
void add_record(CommandLine& tool);
void add_render(CommandLine& tool);
void add_replay(CommandLine& tool);
void add_send(CommandLine& tool);
void add_serve(CommandLine& tool);
void add_solve(CommandLine& tool);
void add_stat(CommandLine& tool);
void add_trace(CommandLine& tool);
void add_trigger(CommandLine& tool);
void add_view(CommandLine& tool);

/// Parses the arguments of `emit` and runs the command that they name. `lab` adds the commands that
/// are not of this folder. Returns the exit code of the process.
[[nodiscard]] int run_tool(int argc, char** argv, const LabCommands& lab);

}  // namespace emit::tool
