// SPDX-License-Identifier: Apache-2.0
#include "tool/command_line/command_line.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>

#include "emit/physics/nearest_name.hpp"
#include "tool/support/console.hpp"
#include "tool/support/output_check.hpp"

namespace emit::tool {

namespace detail {

/// Facts about a program's commands that CLI11 does not keep.
struct Registry {
  struct Leaf {
    CLI::App* app = nullptr;
    std::function<int()> run;
  };
  struct Raw {
    CLI::App* app = nullptr;
    CommandDescription description;
    int (*run)(int argc, char** argv) = nullptr;
  };
  /// CLI11 keeps the choices of an option only as text, and knows nothing of the others.
  struct Value {
    std::vector<std::string> choices;
    std::function<std::vector<std::string>()> suggestions;
    ValueKind kind = ValueKind::text;
  };

  struct Output {
    const CLI::App* app = nullptr;
    std::string option;
    std::function<physics::Result<void>()> check;
  };

  Registry(const std::string& name, const std::string& text) : root(text, name) {}

  CLI::App root;
  std::vector<Leaf> leaves;
  std::vector<Raw> raw;
  std::vector<Output> outputs;
  std::map<const CLI::Option*, Value> values;
};

}  // namespace detail

namespace {

struct UnknownCommand {
  std::string parent;   ///< with the program's name
  std::string command;  ///< all words of it, without the program's name
  std::string hint;     ///< ", did you mean 'COMMAND'?" with all words of it; empty: none is near
};

/// Returns ", did you mean 'COMMAND'?" for a mistyped last word of a command, else an empty text.
/// `before` holds the words before it, with a blank at the end.
std::string hint_at_command(const std::string& before, const std::string& word,
                            const std::vector<std::string>& names) {
  const std::vector<std::string_view> known(names.begin(), names.end());
  const std::string_view near = physics::nearest_name(word, known);
  return near.empty() ? "" : fmt::format(", did you mean '{}{}'?", before, near);
}

/// The first word that should be a command and is none. Empty: something else is wrong with the
/// arguments.
std::optional<UnknownCommand> find_unknown_command(const CLI::App& root, int argc, char** argv) {
  UnknownCommand out{root.get_name(), "", ""};
  const CLI::App* app = &root;
  for (int i = 1; i < argc && app->get_require_subcommand_min() > 0; ++i) {
    const std::string word = argv[i];
    if (word.starts_with('-')) return std::nullopt;
    const std::string before = out.command.empty() ? "" : out.command + " ";
    out.command = before + word;
    std::vector<std::string> names;
    const CLI::App* known = nullptr;
    for (const CLI::App* each : app->get_subcommands([](const CLI::App*) { return true; })) {
      names.push_back(each->get_name());
      if (each->check_name(word)) known = each;
    }
    if (known == nullptr) {
      out.hint = hint_at_command(before, word, names);
      return out;
    }
    out.parent += " " + word;
    app = known;
  }
  return std::nullopt;
}

struct UnknownOption {
  std::string command;  ///< with the program's name
  std::string name;     ///< with dashes
  std::string hint;     ///< ", did you mean '--NAME'?"; empty: none is near
};

const CLI::Option* find_option(const CLI::App& app, const std::string& name) {
  for (const CLI::Option* option : app.get_options()) {
    if (option->check_lname(name)) return option;
  }
  return nullptr;
}

/// The first long option that its command does not have. Empty: something else is wrong with the
/// arguments.
std::optional<UnknownOption> find_unknown_option(const CLI::App& root, int argc, char** argv) {
  const CLI::App* app = &root;
  std::string path = root.get_name();
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--") return std::nullopt;
    if (!word.starts_with("--")) {
      for (const CLI::App* below : app->get_subcommands([](const CLI::App*) { return true; })) {
        if (!below->check_name(word)) continue;
        app = below;
        path += " " + word;
        break;
      }
      continue;
    }
    const std::size_t equals = word.find('=');
    const std::string name = word.substr(2, equals == std::string::npos ? equals : equals - 2);
    if (const CLI::Option* option = find_option(*app, name)) {
      // The next word is the value, whatever it looks like.
      if (equals == std::string::npos && option->get_items_expected_max() > 0) ++i;
      continue;
    }
    std::vector<std::string> names;
    for (const CLI::Option* option : app->get_options()) {
      for (const std::string& known : option->get_lnames()) names.push_back("--" + known);
    }
    return UnknownOption{path, "--" + name, physics::did_you_mean("--" + name, names)};
  }
  return std::nullopt;
}

std::string text_of(const UnknownOption& unknown) {
  return fmt::format("{} has no option '{}'{}; `{} --help` lists them", unknown.command,
                     unknown.name, unknown.hint, unknown.command);
}

std::string text_of(const UnknownCommand& unknown) {
  return fmt::format("there is no command '{}'{}; `{} --help` lists them", unknown.command,
                     unknown.hint, unknown.parent);
}

/// Text of any other fault in the arguments. It names the command whose --help helps.
std::string text_of(const CLI::ParseError& error, const CLI::App& root) {
  const CLI::App* app = &root;
  std::string command = root.get_name();
  while (!app->get_subcommands().empty()) {
    app = app->get_subcommands().front();
    command += " " + app->get_name();
  }
  std::string text = error.what();
  if (app->get_require_subcommand_min() > 0 && dynamic_cast<const CLI::RequiredError*>(&error)) {
    text = fmt::format("a command is missing behind '{}'", command);
  } else if (dynamic_cast<const CLI::ConversionError*>(&error)) {
    text = "could not convert" + text.substr(std::min(text.size(), text.find(':')));
  }
  return fmt::format("{}; see `{} --help`", text, command);
}

OptionDescription description_of(const CLI::Option& option, const detail::Registry& registry) {
  OptionDescription out;
  out.positional = option.get_positional();
  if (out.positional) {
    out.names.push_back(option.get_name(true, false));
  } else {
    for (const std::string& name : option.get_snames()) out.names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) out.names.push_back("--" + name);
  }
  out.required = option.get_required();
  out.takes_value = option.get_items_expected_max() > 0;
  out.repeatable = option.get_expected_max() > 1;
  if (out.takes_value) {
    // CLI11 writes the type and its checks as "TYPE:CHECK".
    const std::string type = option.get_type_name();
    out.value = type.substr(0, type.find(':'));
    out.default_text = option.get_default_str();
  }
  if (const auto found = registry.values.find(&option); found != registry.values.end()) {
    const detail::Registry::Value& value = found->second;
    out.choices = value.choices;
    if (value.suggestions) out.suggestions = value.suggestions();
    out.kind = value.kind == ValueKind::file && out.value == "DIR" ? ValueKind::folder : value.kind;
  }
  out.text = option.get_description();
  return out;
}

CommandDescription description_of(const CLI::App& app, const detail::Registry& registry) {
  for (const detail::Registry::Raw& raw : registry.raw) {
    if (raw.app == &app) return raw.description;
  }
  CommandDescription out;
  out.name = app.get_name();
  out.text = app.get_description();
  out.footer = app.get_footer();
  for (const CLI::Option* option : app.get_options())
    out.options.push_back(description_of(*option, registry));
  for (const CLI::App* below : app.get_subcommands([](const CLI::App*) { return true; })) {
    out.commands.push_back(description_of(*below, registry));
  }
  return out;
}

}  // namespace

Option& Option::required() {
  option_->required();
  return *this;
}

Option& Option::type_name(const std::string& name) {
  option_->type_name(name);
  return *this;
}

Option& Option::in_range(int low, int high) {
  option_->check(CLI::Range(low, high));
  return *this;
}

Option& Option::in_range(unsigned low, unsigned high) {
  option_->check(CLI::Range(low, high));
  return *this;
}

Option& Option::in_range(std::uint64_t low, std::uint64_t high) {
  option_->check(CLI::Range(low, high));
  return *this;
}

Option& Option::in_range(double low, double high) {
  option_->check(CLI::Range(low, high));
  return *this;
}

Option& Option::positive() {
  option_->check({[](std::string& text) -> std::string {
                    double value = 0.0;
                    const bool number = CLI::detail::lexical_cast(text, value);
                    if (number && value > 0.0 && std::isfinite(value)) return {};
                    return fmt::format("{} is not a number above 0", text);
                  },
                  "POSITIVE"});
  return *this;
}

Option& Option::one_of(const std::vector<std::string>& values) {
  CLI::IsMember member(values);
  member.operation([plain = CLI::Validator(CLI::IsMember(values)), values](std::string& text) {
    const std::string fault = plain(text);
    return fault.empty() ? fault : fault + physics::did_you_mean(text, values);
  });
  option_->check(member);
  registry_->values[option_].choices = values;
  return *this;
}

Option& Option::one_of_numbers(const std::vector<int>& values) {
  option_->check(CLI::IsMember(values));
  auto& choices = registry_->values[option_].choices;
  for (const int value : values) choices.push_back(fmt::format("{}", value));
  return *this;
}

Option& Option::suggest(std::function<std::vector<std::string>()> values) {
  registry_->values[option_].suggestions = std::move(values);
  return *this;
}

Option& Option::may_be_file() {
  registry_->values[option_].kind = ValueKind::file;
  return *this;
}

Option& Option::show_default() {
  option_->capture_default_str();
  return *this;
}

Option& Option::default_text(const std::string& text) {
  option_->default_str(text);
  return *this;
}

Option& Option::repeatable() {
  option_->allow_extra_args(false);
  return *this;
}

Option& Option::needs(const Option& other) {
  option_->needs(other.option_);
  return *this;
}

Option& Option::excludes(const Option& other) {
  option_->excludes(other.option_);
  return *this;
}

Option CommandLine::option(const std::string& name, std::string& target, const std::string& text) {
  return {*registry_, *app_->add_option(name, target, text)};
}

Option CommandLine::option(const std::string& name, int& target, const std::string& text) {
  return {*registry_, *app_->add_option(name, target, text)};
}

Option CommandLine::option(const std::string& name, std::uint16_t& target,
                           const std::string& text) {
  return {*registry_, *app_->add_option(name, target, text)};
}

Option CommandLine::option(const std::string& name, std::uint32_t& target,
                           const std::string& text) {
  return {*registry_, *app_->add_option(name, target, text)};
}

Option CommandLine::option(const std::string& name, std::uint64_t& target,
                           const std::string& text) {
  return {*registry_, *app_->add_option(name, target, text)};
}

Option CommandLine::option(const std::string& name, double& target, const std::string& text) {
  return {*registry_, *app_->add_option(name, target, text)};
}

Option CommandLine::option(const std::string& name, std::optional<std::uint32_t>& target,
                           const std::string& text) {
  return {*registry_, *app_->add_option(name, target, text)};
}

Option CommandLine::option(const std::string& name, std::optional<std::uint64_t>& target,
                           const std::string& text) {
  return {*registry_, *app_->add_option(name, target, text)};
}

Option CommandLine::option(const std::string& name, std::optional<double>& target,
                           const std::string& text) {
  return {*registry_, *app_->add_option(name, target, text)};
}

Option CommandLine::option(const std::string& name, std::vector<std::string>& target,
                           const std::string& text) {
  return {*registry_, *app_->add_option(name, target, text)};
}

Option CommandLine::option(const std::string& name, std::vector<std::uint32_t>& target,
                           const std::string& text) {
  return {*registry_, *app_->add_option(name, target, text)};
}

Option CommandLine::option(const std::string& name, std::vector<double>& target,
                           const std::string& text) {
  return {*registry_, *app_->add_option(name, target, text)};
}

Option CommandLine::parsed(const std::string& name,
                           std::function<physics::Result<void>(const std::string&)> parse,
                           const std::string& text) {
  return {*registry_, *app_->add_option_function<std::string>(
                          name,
                          [name, parse = std::move(parse)](const std::string& value) {
                            const auto done = parse(value);
                            if (!done) throw CLI::ValidationError(name, done.error().text);
                          },
                          text)};
}

Option CommandLine::flag(const std::string& name, bool& target, const std::string& text) {
  return {*registry_, *app_->add_flag(name, target, text)};
}

Option CommandLine::path(const std::string& name, std::filesystem::path& target,
                         const std::string& text) {
  Option option{*registry_,
                *app_->add_option_function<std::string>(
                    name, [&target](const std::string& value) { target = value; }, text)};
  return option.type_name("FILE").may_be_file();
}

Option CommandLine::path(const std::string& name, std::optional<std::filesystem::path>& target,
                         const std::string& text) {
  Option option{
      *registry_,
      *app_->add_option_function<std::string>(
          name, [&target](const std::string& value) { target = std::filesystem::path(value); },
          text)};
  return option.type_name("FILE").may_be_file();
}

namespace {

/// The path that an option was given or has by default; none: nothing is written.
std::optional<std::filesystem::path> given(const std::filesystem::path& target) {
  return target.empty() ? std::nullopt : std::optional(target);
}

std::optional<std::filesystem::path> given(const std::optional<std::filesystem::path>& target) {
  return target;
}

template <class Target>
std::function<physics::Result<void>()> file_check(const Target& target) {
  return [&target]() -> physics::Result<void> {
    const auto file = given(target);
    if (!file || *file == "-") return {};
    return check_output_file(*file);
  };
}

template <class Target>
std::function<physics::Result<void>()> folder_check(const Target& target,
                                                    CommandLine::OutputFolder folder) {
  return [&target, folder]() -> physics::Result<void> {
    const auto path = given(target);
    if (!path) return {};
    // A file of any name stands for those that the command writes into an existing folder.
    return folder == CommandLine::OutputFolder::exists ? check_output_file(*path / "file")
                                                       : check_output_folder(*path);
  };
}

}  // namespace

void CommandLine::check_output(const std::string& option,
                               std::function<physics::Result<void>()> check) const {
  registry_->outputs.push_back({app_, option, std::move(check)});
}

Option CommandLine::output_file(const std::string& name, std::filesystem::path& target,
                                const std::string& text) {
  check_output(name, file_check(target));
  return path(name, target, text);
}

Option CommandLine::output_file(const std::string& name,
                                std::optional<std::filesystem::path>& target,
                                const std::string& text) {
  check_output(name, file_check(target));
  return path(name, target, text);
}

Option CommandLine::exr_file(const std::string& name, std::filesystem::path& target,
                             const std::string& text) {
  check_output(name, [&target] { return check_image_name(target, ImageFormat::exr); });
  return output_file(name, target, text);
}

Option CommandLine::png_file(const std::string& name, std::optional<std::filesystem::path>& target,
                             const std::string& text) {
  check_output(name, [&target]() -> physics::Result<void> {
    if (!target) return {};
    return check_image_name(*target, ImageFormat::png);
  });
  return output_file(name, target, text);
}

Option CommandLine::output_folder(const std::string& name, std::filesystem::path& target,
                                  const std::string& text, OutputFolder folder) {
  check_output(name, folder_check(target, folder));
  return path(name, target, text).type_name("DIR");
}

Option CommandLine::output_folder(const std::string& name,
                                  std::optional<std::filesystem::path>& target,
                                  const std::string& text, OutputFolder folder) {
  check_output(name, folder_check(target, folder));
  return path(name, target, text).type_name("DIR");
}

Option CommandLine::output_file_or_folder(const std::string& name, std::filesystem::path& target,
                                          std::function<bool()> is_file, const std::string& text) {
  check_output(name, [&target, is_file = std::move(is_file)] {
    return is_file() ? check_output_file(target) : check_output_folder(target);
  });
  return path(name, target, text).type_name("DIR_OR_FILE");
}

Option CommandLine::count(const std::string& name, std::uint64_t& target, const std::string& text) {
  return option(name, target, text).type_name("N");
}

Option CommandLine::seconds(const std::string& name, double& target, const std::string& text) {
  return option(name, target, text).type_name("S");
}

void CommandLine::footer(const std::string& text) {
  app_->footer(text);
}

CommandLine CommandLine::leaf(const CommandText& text, std::function<int()> run) {
  CLI::App* app = app_->add_subcommand(text.name, text.text);
  app->footer("Example: " + text.example);
  registry_->leaves.push_back({app, std::move(run)});
  return {*registry_, *app};
}

CommandLine CommandLine::group(const CommandText& text) {
  CLI::App* app = app_->add_subcommand(text.name, text.text);
  app->require_subcommand(1);
  app->footer("Example: " + text.example);
  return {*registry_, *app};
}

void CommandLine::raw_command(const CommandDescription& description,
                              int (*run)(int argc, char** argv)) {
  CLI::App* app = app_->add_subcommand(description.name, description.text);
  registry_->raw.push_back({app, description, run});
}

CommandDescription CommandLine::describe() const {
  return description_of(*app_, *registry_);
}

std::vector<std::string> CommandLine::command_names() const {
  std::vector<std::string> names;
  for (const CLI::App* below : app_->get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(below->get_name());
  }
  return names;
}

Program::Program(const std::string& name, const std::string& text, const std::string& version,
                 const std::string& footer)
    : registry_(std::make_unique<detail::Registry>(name, text)) {
  registry_->root.set_version_flag("--version", version);
  registry_->root.require_subcommand(1);
  registry_->root.footer(footer);
}

Program::~Program() = default;

CommandLine Program::root() noexcept {
  return {*registry_, registry_->root};
}

int Program::run(int argc, char** argv) {
  // A raw command reads its own arguments: CLI11 does not see them.
  for (const auto& [app, description, run] : registry_->raw) {
    if (argc >= 2 && app->check_name(argv[1])) return run(argc - 1, argv + 1);
  }
  CLI::App& root = registry_->root;
  try {
    root.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {
      root.exit(error);  // prints what --help or --version asks for
      return kExitOk;
    }
    if (const auto unknown = find_unknown_command(root, argc, argv)) {
      return fail(kExitUsage, text_of(*unknown));
    }
    if (const auto unknown = find_unknown_option(root, argc, argv)) {
      return fail(kExitUsage, text_of(*unknown));
    }
    return fail(kExitUsage, text_of(error, root));
  }
  for (const auto& [app, option, check] : registry_->outputs) {
    if (!app->parsed()) continue;
    if (const auto writable = check(); !writable) {
      return fail_call(physics::Error(writable.error()).with_context(option));
    }
  }
  for (const auto& [app, run] : registry_->leaves) {
    if (app->parsed()) return run();
  }
  return kExitUsage;
}

}  // namespace emit::tool
