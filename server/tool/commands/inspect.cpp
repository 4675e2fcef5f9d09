// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdio>
#include <fstream>

#include "emit/scene/inspect.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/support/console.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

struct InspectOptions {
  std::filesystem::path file;
  std::optional<std::filesystem::path> json;
};

int run(const InspectOptions& command) {
  const std::vector<scene::Material> library = material_library();
  const auto summary = scene::inspect_gltf(command.file, library);
  if (!summary) return fail(summary.error());
  const std::string text = scene::to_text(*summary);
  if (command.json != std::filesystem::path("-")) {
    std::fwrite(text.data(), 1, text.size(), stdout);
    if (!text.ends_with('\n')) std::fputc('\n', stdout);
  }
  if (!command.json) return kExitOk;

  const std::string json = scene::to_json(*summary);
  if (*command.json == "-") {
    fmt::print("{}\n", json);
    return kExitOk;
  }
  std::ofstream file(*command.json, std::ios::binary);
  file << json << '\n';
  file.close();
  if (!file) return fail(kExitFailure, fmt::format("{}: cannot write", command.json->string()));
  return kExitOk;
}

void add_options(CommandLine& line, InspectOptions& options) {
  line.path("scene", options.file, "glTF 2.0 file (.glb or .gltf)").required();
  add_json(line, options.json);
}

}  // namespace

void add_inspect(CommandLine& tool) {
  tool.command<InspectOptions>({.name = "inspect",
                                .text = "Show what the loader sees in a glTF file",
                                .example = "emit inspect scene.glb"},
                               add_options, run);
}

}  // namespace emit::tool
