// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tool/commands/commands.hpp"
#include "tool/support/console.hpp"
#include "emit/version.hpp"
#include "tool/streams/error_correction.hpp"

/// The command line of `emit`: every option of every subcommand. Included by arguments*.cpp alone:
/// nothing else knows CLI11.
namespace emit::tool {

/// Options that several subcommands have.
CLI::Option* add_path(CLI::App& app, const std::string& name, std::filesystem::path& target,
                      const std::string& text);
CLI::Option* add_path(CLI::App& app, const std::string& name,
                      std::optional<std::filesystem::path>& target, const std::string& text);
void add_json(CLI::App& app, std::optional<std::filesystem::path>& target);
void add_set(CLI::App& app, std::vector<std::string>& target);
void add_scenario(CLI::App& app, ScenarioChoice& target, const std::string& name);
void add_gpu(CLI::App& app, int& target);
/// --tls-* of every command that connects to a control port.
void add_security(CLI::App& app, client::Security& target);
CLI::Option* add_count(CLI::App& app, const std::string& name, std::uint64_t& target,
                       const std::string& text);
CLI::Option* add_seconds(CLI::App& app, const std::string& name, double& target,
                         const std::string& text);

/// For numbers above 0.
[[nodiscard]] CLI::Validator positive();

/// K+M, groups of up to K fragments with M of parity, or off.
template <class Target>
CLI::Option* add_error_correction(CLI::App& app, const std::string& name, Target& target) {
  return app
      .add_option_function<std::string>(
          name,
          [&target](const std::string& text) {
            const auto fec = parse_error_correction(text);
            if (!fec) throw CLI::ValidationError("--fec", fec.error().text);
            target = *fec;
          },
          "UDP: error correction, K+M: groups of up to K fragments with M parity fragments, of "
          "which any M may be lost, e.g. 48+5; off: none")
      ->type_name("K+M");
}

/// A subcommand's options must outlive parsing: they live in the closure that runs it.
class Tool {
 public:
  Tool()
      : app_("emit: command-line tool of emitd, the real-time infrared image generator.", "emit") {
    app_.set_version_flag("--version", std::string("emit ") + kVersion + " (" + kCommit + ")");
    app_.require_subcommand(1);
    app_.footer(
        "Exit codes: 0 success, 2 bad usage, 78 bad configuration or scenario, 75 the device was "
        "lost "
        "(serve), 1 any other failure.\n"
        "Example: emit demo --out frames");
    add_scene_commands();
    add_stream_commands();
    add_timing_commands();
    add_log_commands();
    add_model_commands();
    add_bench_commands();
  }

  int run(int argc, char** argv) {
    try {
      app_.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      if (const auto unknown = unknown_command(argc, argv)) {
        return fail(kExitUsage, fmt::format("there is no command '{}'; `{} --help` lists them",
                                            unknown->command, unknown->parent));
      }
      return app_.exit(error) == 0 ? kExitOk : kExitUsage;
    }
    for (const auto& [command, action] : actions_) {
      if (command->parsed()) return action();
    }
    return kExitUsage;
  }

 private:
  struct UnknownCommand {
    std::string parent;   ///< with the tool's name
    std::string command;  ///< all of it, without
  };
  /// Empty: it is something else that cannot be parsed.
  [[nodiscard]] std::optional<UnknownCommand> unknown_command(int argc, char** argv) const;

  template <class Options>
  struct Entry {
    CLI::App& app;
    Options& options;
  };

  template <class Options>
  Entry<Options> add(CLI::App& parent, const std::string& name, const std::string& text,
                     const std::string& example, int (*action)(const Options&)) {
    CLI::App* command = parent.add_subcommand(name, text);
    command->footer("Example: " + example);
    auto options = std::make_shared<Options>();
    actions_.emplace_back(command, [options, action] { return action(*options); });
    return {*command, *options};
  }

  void add_scene_commands();
  void add_stream_commands();
  void add_timing_commands();
  void add_log_commands();
  void add_model_commands();
  void add_bench_commands();
  void add_frame_time_benches(CLI::App& bench);

  CLI::App app_;
  std::vector<std::pair<CLI::App*, std::function<int()>>> actions_;
};

}  // namespace emit::tool
