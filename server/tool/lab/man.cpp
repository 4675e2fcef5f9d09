// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <fstream>

#include "emit/physics/nearest_name.hpp"
#include "emit/version.hpp"
#include "tool/command_line/man_page.hpp"
#include "tool/lab/lab.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"

namespace emit::tool {
namespace {

struct ManOptions {
  std::vector<std::string> command;
  std::optional<std::filesystem::path> out;
};

/// All pages: those of the tool and its commands, and that of the daemon.
std::vector<ManFile> all_pages(const CommandDescription& tool) {
  std::vector<ManFile> pages = man_pages(tool, fmt::format("emit {}", kVersion));
  for (CommandDescription command : tool.commands) {
    if (command.name != "serve") continue;
    command.text = "real-time infrared image generator for hardware-in-the-loop rigs";
    const ManHeading heading{
        "emitd", "emitd", 8, fmt::format("emitd {}", kVersion), {"emit(1)", "emit-serve(1)"}};
    pages.push_back({"emitd.8", man_page(command, heading)});
  }
  return pages;
}

std::string title_of(const ManFile& page) {
  return page.name.substr(0, page.name.rfind('.'));
}

int write_pages(const std::filesystem::path& folder, const std::vector<ManFile>& pages) {
  if (auto made = make_directory(folder); !made) return fail(made.error());
  for (const ManFile& page : pages) {
    const auto path = folder / page.name;
    std::ofstream file(path, std::ios::binary);
    file << page.text;
    file.close();
    if (!file) return fail(kExitFailure, fmt::format("{}: cannot write", path.string()));
  }
  return kExitOk;
}

int run(const CommandLine& tool, const ManOptions& command) {
  const std::vector<ManFile> pages = all_pages(tool.describe());
  if (command.out) return write_pages(*command.out, pages);
  std::string title = "emit";
  if (command.command == std::vector<std::string>{"emitd"}) {
    title = "emitd";
  } else {
    for (const std::string& word : command.command) title += "-" + word;
  }
  std::vector<std::string> titles;
  for (const ManFile& page : pages) {
    titles.push_back(title_of(page));
    if (titles.back() != title) continue;
    fmt::print("{}", page.text);
    return kExitOk;
  }
  return fail(kExitUsage,
              fmt::format("there is no page '{}'{}", title, physics::did_you_mean(title, titles)));
}

void add_options(const CommandLine& tool, CommandLine& line, ManOptions& options) {
  const Option command =
      line.option("command", options.command,
                  "Command, e.g. 'render' or 'bench paper', or emitd; default: the page of emit")
          .type_name("COMMAND")
          .suggest([tool] {
            std::vector<std::string> names = tool.command_names();
            names.emplace_back("emitd");
            return names;
          });
  line.output_folder("--out", options.out, "Write all pages into this folder instead")
      .excludes(command);
}

}  // namespace

void add_man(CommandLine& tool) {
  tool.command<ManOptions>(
      kManText,
      std::function<void(CommandLine&, ManOptions&)>(
          [tool](CommandLine& line, ManOptions& options) { add_options(tool, line, options); }),
      std::function<int(const ManOptions&)>(
          [tool](const ManOptions& command) { return run(tool, command); }));
}

}  // namespace emit::tool
