// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "emit/physics/error.hpp"
#include "tool/command_line/command_description.hpp"

/// The command line of `emit`, without the library that parses it: CLI11 takes seconds of compiler
/// time in every file that includes it, so that command_line.cpp alone does.
namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace emit::tool {

namespace detail {
struct Registry;
}

/// One option that was just declared; the calls refine it and can be chained. A cheap handle, valid
/// as long as the Program.
class Option {
 public:
  Option& required();
  /// Sets what --help calls the value, e.g. "FILE".
  Option& type_name(const std::string& name);
  /// Other values end the program with exit code 2. Both ends belong to the range.
  Option& in_range(int low, int high);
  Option& in_range(unsigned low, unsigned high);
  Option& in_range(std::uint64_t low, std::uint64_t high);
  Option& in_range(double low, double high);
  /// Finite numbers above 0.
  Option& positive();
  Option& one_of(const std::vector<std::string>& values);
  Option& one_of_numbers(const std::vector<int>& values);
  /// Values that shells offer; others are taken too. `values` runs when the command is described.
  Option& suggest(std::function<std::vector<std::string>()> values);
  /// The value may be a file too, so that shells offer files.
  Option& may_be_file();
  /// --help shows the target's value as the default.
  Option& show_default();
  Option& default_text(const std::string& text);
  /// A list option takes one value each time that it is given.
  Option& repeatable();
  /// The option is refused without `other`.
  Option& needs(const Option& other);
  /// The option is refused together with `other`.
  Option& excludes(const Option& other);

 private:
  friend class CommandLine;
  Option(detail::Registry& registry, CLI::Option& option)
      : registry_(&registry), option_(&option) {}
  detail::Registry* registry_;
  CLI::Option* option_;
};

/// Name and texts of a command.
struct CommandText {
  std::string name;
  std::string text;     ///< one line
  std::string example;  ///< a command line that works
};

/// A command under construction: options and commands are added to it. A cheap handle, valid as
/// long as the Program. Targets of options outlive the Program's run().
class CommandLine {
 public:
  /// A value of the target's type. "--name" is an option, "name" a positional argument.
  Option option(const std::string& name, std::string& target, const std::string& text);
  Option option(const std::string& name, int& target, const std::string& text);
  Option option(const std::string& name, std::uint16_t& target, const std::string& text);
  Option option(const std::string& name, std::uint32_t& target, const std::string& text);
  Option option(const std::string& name, std::uint64_t& target, const std::string& text);
  Option option(const std::string& name, double& target, const std::string& text);
  Option option(const std::string& name, std::optional<std::uint32_t>& target,
                const std::string& text);
  Option option(const std::string& name, std::optional<std::uint64_t>& target,
                const std::string& text);
  Option option(const std::string& name, std::optional<double>& target, const std::string& text);
  Option option(const std::string& name, std::vector<std::string>& target, const std::string& text);
  Option option(const std::string& name, std::vector<std::uint32_t>& target,
                const std::string& text);
  Option option(const std::string& name, std::vector<double>& target, const std::string& text);
  /// A text that `parse` reads. Its error ends the program with exit code 2.
  Option parsed(const std::string& name,
                std::function<physics::Result<void>(const std::string&)> parse,
                const std::string& text);
  Option flag(const std::string& name, bool& target, const std::string& text);
  /// A file or folder that is read.
  Option path(const std::string& name, std::filesystem::path& target, const std::string& text);
  Option path(const std::string& name, std::optional<std::filesystem::path>& target,
              const std::string& text);
  /// A file that the command writes. Program::run() checks before the command runs that it can be
  /// written; "-" stands for standard output and is not checked.
  Option output_file(const std::string& name, std::filesystem::path& target,
                     const std::string& text);
  Option output_file(const std::string& name, std::optional<std::filesystem::path>& target,
                     const std::string& text);
  /// A frame that the command writes as OpenEXR, or a picture of it as PNG. It is checked as an
  /// output_file() is, and other extensions than .exr or .png are refused.
  Option exr_file(const std::string& name, std::filesystem::path& target, const std::string& text);
  Option png_file(const std::string& name, std::optional<std::filesystem::path>& target,
                  const std::string& text);
  /// A folder that the command writes files into. It is checked as an output_file() is. With
  /// `OutputFolder::exists` the command does not create it.
  enum class OutputFolder : std::uint8_t { created, exists };
  Option output_folder(const std::string& name, std::filesystem::path& target,
                       const std::string& text, OutputFolder folder = OutputFolder::created);
  Option output_folder(const std::string& name, std::optional<std::filesystem::path>& target,
                       const std::string& text, OutputFolder folder = OutputFolder::created);
  /// A file or a folder that the command writes, whichever `is_file` says once the line is parsed.
  /// It is checked as an output_file() or an output_folder() is.
  Option output_file_or_folder(const std::string& name, std::filesystem::path& target,
                               std::function<bool()> is_file, const std::string& text);
  /// A number that counts something.
  Option count(const std::string& name, std::uint64_t& target, const std::string& text);
  Option seconds(const std::string& name, double& target, const std::string& text);

  /// Replaces the lines below the options; by default they are the example.
  void footer(const std::string& text);

  /// Adds a command with options of its own. `run` returns the exit code of the process.
  template <class Options>
  void command(const CommandText& text, void (*add_options)(CommandLine&, Options&),
               int (*run)(const Options&)) {
    command<Options>(text, std::function<void(CommandLine&, Options&)>(add_options),
                     std::function<int(const Options&)>(run));
  }
  /// The same for functions that hold more than the options, e.g. the tool itself.
  template <class Options>
  void command(const CommandText& text,
               const std::function<void(CommandLine&, Options&)>& add_options,
               std::function<int(const Options&)> run) {
    // Options must outlive parsing: they live in the closure that runs the command.
    auto options = std::make_shared<Options>();
    CommandLine line = leaf(text, [options, run = std::move(run)] { return run(*options); });
    add_options(line, *options);
  }
  /// Adds a command that only holds others.
  CommandLine group(const CommandText& text);
  /// Adds a command that parses its own arguments, as a main() does; argv[0] is its name.
  /// `description` has the name and what --help of the command says.
  void raw_command(const CommandDescription& description, int (*run)(int argc, char** argv));

  /// The command with all that was added to it so far.
  [[nodiscard]] CommandDescription describe() const;
  /// Names of the commands that were added to it so far.
  [[nodiscard]] std::vector<std::string> command_names() const;

 private:
  friend class Program;
  CommandLine(detail::Registry& registry, CLI::App& app) : registry_(&registry), app_(&app) {}
  CommandLine leaf(const CommandText& text, std::function<int()> run);
  /// Adds a check that Program::run() makes before it runs the command.
  void check_output(const std::string& option, std::function<physics::Result<void>()> check) const;

  detail::Registry* registry_;
  CLI::App* app_;
};

/// A program of commands. Single thread, setup only.
class Program {
 public:
  /// `version` is what --version prints, `footer` stands below the list of commands in --help.
  Program(const std::string& name, const std::string& text, const std::string& version,
          const std::string& footer);
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  [[nodiscard]] CommandLine root() noexcept;
  /// Parses the arguments and runs the command that they name. Returns the exit code of the
  /// process: that of the command, 0 after --help and --version, 2 where the arguments are wrong,
  /// which standard error explains.
  [[nodiscard]] int run(int argc, char** argv);

 private:
  std::unique_ptr<detail::Registry> registry_;
};

}  // namespace emit::tool
