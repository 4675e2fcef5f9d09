// SPDX-License-Identifier: Apache-2.0
#include "tool/command_line/completion.hpp"

#include <fmt/format.h>

#include <fstream>

#include "tool/lab/lab.hpp"
#include "tool/support/console.hpp"

namespace emit::tool {
namespace {

struct CompletionOptions {
  std::string shell;
  std::optional<std::filesystem::path> out;
};

int run(const CommandLine& tool, const CompletionOptions& command) {
  const CommandDescription description = tool.describe();
  const std::string script = command.shell == "bash"   ? bash_completion(description)
                             : command.shell == "fish" ? fish_completion(description)
                                                       : zsh_completion(description);
  if (!command.out) {
    fmt::print("{}", script);
    return kExitOk;
  }
  std::ofstream file(*command.out, std::ios::binary);
  file << script;
  file.close();
  return file ? kExitOk
              : fail(kExitFailure, fmt::format("{}: cannot write", command.out->string()));
}

void add_options(CommandLine& line, CompletionOptions& options) {
  line.option("shell", options.shell, "Shell that runs the script")
      .required()
      .one_of({"bash", "zsh", "fish"});
  line.output_file("--out", options.out, "Write the script to a file instead");
}

}  // namespace

void add_completion(CommandLine& tool) {
  tool.command<CompletionOptions>(
      kCompletionText,
      std::function<void(CommandLine&, CompletionOptions&)>(
          [](CommandLine& line, CompletionOptions& options) { add_options(line, options); }),
      std::function<int(const CompletionOptions&)>(
          [tool](const CompletionOptions& command) { return run(tool, command); }));
}

}  // namespace emit::tool
