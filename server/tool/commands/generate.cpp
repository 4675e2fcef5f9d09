// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/support/console.hpp"
#include "tool/support/scene_options.hpp"

namespace emit::tool {
namespace {

struct GenerateOptions {
  std::string scene;
  std::filesystem::path out;
  std::vector<std::string> set;
};

int run(const GenerateOptions& command) {
  const auto done = generate_scenes(command.scene, command.out, command.set);
  return done ? kExitOk : fail_call(done.error());
}

void add_options(CommandLine& line, GenerateOptions& options) {
  line.option("scene", options.scene, fmt::format("Scene: {}", fmt::join(scene_names(), ", ")))
      .required()
      .type_name("SCENE")
      .suggest(scene_names);
  line.output_folder("--out", options.out, "Folder to write into").required();
  add_set(line, options.set);
}

}  // namespace

void add_generate(CommandLine& tool) {
  tool.command<GenerateOptions>(
      {.name = "generate",
       .text = "Write one of the shipped scenes, or all, as glTF",
       .example = "emit generate block-on-road --out scenes --set block_size_m=1.5"},
      add_options, run);
}

}  // namespace emit::tool
