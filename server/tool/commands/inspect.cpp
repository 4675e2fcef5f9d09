// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdio>
#include <fstream>

#include "emit/config/load.hpp"
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

/// Returns advice for a file that is no glTF file: its kind and the command for it. The text is
/// empty if the kind is not known.
std::string advice_on(const std::filesystem::path& file) {
  const std::string name = file.string();
  switch (config::kind_of_file(file)) {
    case config::FileKind::scenario:
      return fmt::format(
          "it is a scenario: `emit render {} --time-s T --out F.exr` renders it, and its key "
          "'gltf' names the scene files for emit inspect",
          name);
    case config::FileKind::daemon:
      return fmt::format("it is a configuration of the daemon: `emitd --config {}` runs it", name);
    case config::FileKind::materials:
      return "it is a library of materials: a scenario names it in the key 'materials'";
    case config::FileKind::unknown:
      break;
  }
  const std::string extension = file.extension().string();
  if (extension == ".exr") {
    return fmt::format("it is a frame: `emit compare {} OTHER.exr` shows its differences", name);
  }
  if (extension == ".mcap") {
    return fmt::format(
        "it is a log: `emit send {0} --to URL` plays its poses, and `emit replay {0} --scenario S` "
        "renders a journal",
        name);
  }
  return {};
}

int run(const InspectOptions& command) {
  const std::vector<scene::Material> library = material_library();
  const auto summary = scene::inspect_gltf(command.file, library);
  if (!summary) {
    physics::Error error = summary.error();
    if (const std::string advice = advice_on(command.file); !advice.empty()) {
      error.text =
          fmt::format("{}: not a glTF file (.glb or .gltf); {}", command.file.string(), advice);
    }
    return fail(error);
  }
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
