// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "tool/command_line/completion.hpp"

namespace emit::tool {
namespace {

std::string quoted(std::string_view text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'') {
      out += "'\\''";
    } else {
      out += c;
    }
  }
  return out + "'";
}

/// Text without what ends a part of a specification of _arguments.
std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

/// Message and action of _arguments for a value.
std::string value_of(const OptionDescription& option) {
  const std::string name = option.value.empty() ? option.names.back() : option.value;
  const std::string words = detail::joined(detail::offered_values(option), " ");
  const char* files = option.kind == ValueKind::file     ? "_files"
                      : option.kind == ValueKind::folder ? "_files -/"
                                                         : "";
  std::string action = files;
  if (!words.empty()) {
    action =
        *files == '\0' ? "(" + words + ")" : fmt::format("{{ compadd -- {}; {} }}", words, files);
  }
  return fmt::format(":{}:{}", escaped(name), action.empty() ? " " : action);
}

/// Specifications of one option or argument for _arguments.
std::string specification(const OptionDescription& option, std::size_t position) {
  if (option.positional) {
    const std::string where = option.repeatable ? "*" : std::to_string(position);
    return quoted(where + value_of(option));
  }
  std::string out;
  const std::string others =
      option.repeatable ? "*" : fmt::format("({})", detail::joined(option.names, " "));
  for (const std::string& name : option.names) {
    const std::string text = fmt::format("[{}]", escaped(detail::short_text(option.text)));
    const char* equals = option.takes_value && name.starts_with("--") ? "=" : "";
    if (!out.empty()) out += " ";
    out += quoted(fmt::format("{}{}{}{}{}", others, name, equals, text,
                              option.takes_value ? value_of(option) : ""));
  }
  return out;
}

std::string function_of(const std::string& path) {
  std::string name = "_" + path;
  std::ranges::replace(name, ' ', '_');
  return name;
}

std::string function(const std::string& path, const CommandDescription& command) {
  std::string specifications;
  std::size_t position = 1;
  for (const OptionDescription& option : command.options) {
    specifications += " \\\n    " + specification(option, position);
    if (option.positional) ++position;
  }
  const std::string name = function_of(path);
  if (command.commands.empty()) {
    return fmt::format("\n{}() {{\n  _arguments{}\n}}\n", name, specifications);
  }
  std::string commands;
  std::string arms;
  for (const CommandDescription& below : command.commands) {
    commands += " \\\n        " + quoted(below.name + ":" + detail::short_text(below.text));
    arms += fmt::format("        {}) {} ;;\n", below.name, function_of(path + " " + below.name));
  }
  return fmt::format(
      "\n{}() {{\n"
      "  local curcontext=$curcontext state line\n"
      "  local -A opt_args\n"
      "  _arguments -C{} \\\n"
      "    '1:command:->command' '*::argument:->argument' && return 0\n"
      "  case $state in\n"
      "    command)\n"
      "      local -a commands=({})\n"
      "      _describe -t commands command commands ;;\n"
      "    argument)\n"
      "      case $line[1] in\n"
      "{}"
      "      esac ;;\n"
      "  esac\n"
      "}}\n",
      name, specifications, commands, arms);
}

}  // namespace

std::string zsh_completion(const CommandDescription& program) {
  std::string out = fmt::format(
      "#compdef {0}\n# Completion of {0} in zsh. The script is made by `{0} completion zsh`.\n",
      program.name);
  detail::visit_commands(program, [&](const std::string& path, const CommandDescription& command) {
    out += function(path, command);
  });
  // Zsh runs the file as the function itself; `source` only defines it.
  return out + fmt::format(
                   "\nif [[ $funcstack[1] == _{0} ]]; then\n  _{0} \"$@\"\nelse\n"
                   "  compdef _{0} {0}\nfi\n",
                   program.name);
}

}  // namespace emit::tool
