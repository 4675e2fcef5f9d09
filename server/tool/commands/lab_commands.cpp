// SPDX-License-Identifier: Apache-2.0
#include "tool/commands/lab_commands.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <string>
#include <system_error>
#include <vector>

#include "tool/support/console.hpp"
#include "tool/support/subprocess.hpp"

namespace emit::tool {
namespace {

/// Replaces this process by emit-lab with the same arguments. argv[0] is the command.
int run_lab(int argc, char** argv) {
  const auto folder = executable_dir();
  if (!folder) return fail(folder.error());
  const std::string program = *folder / "emit-lab";
  std::string name = "emit";
  std::vector<char*> arguments = {name.data()};
  arguments.insert(arguments.end(), argv, argv + argc);
  arguments.push_back(nullptr);
  ::execv(program.c_str(), arguments.data());
  const std::error_code error(errno, std::generic_category());
  return fail(kExitFailure,
              fmt::format("{}: {}; `emit {}` is a command of that program, which is built by "
                          "`cmake --build --preset release --target emit_lab`",
                          program, error.message(), argv[0]));
}

void add(CommandLine& tool, const CommandText& text) {
  CommandDescription description;
  description.name = text.name;
  description.text = text.text;
  tool.raw_command(description, run_lab);
}

}  // namespace

LabCommands forwarded_lab_commands() {
  return {.evaluate = [](CommandLine& tool) { add(tool, kEvaluateText); },
          .fit = [](CommandLine& tool) { add(tool, kFitText); },
          .materials = [](CommandLine& tool) { add(tool, kMaterialsText); },
          .bench = [](CommandLine& tool) { add(tool, kBenchText); },
          .completion = [](CommandLine& tool) { add(tool, kCompletionText); },
          .man = [](CommandLine& tool) { add(tool, kManText); }};
}

}  // namespace emit::tool
