// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "tool/command_line/completion.hpp"

namespace emit::tool {
namespace {

std::string quoted(std::string_view text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'' || c == '\\') out += '\\';
    out += c;
  }
  return out + "'";
}

/// Arguments of `complete` that say what a value is.
std::string value_of(const OptionDescription& option) {
  std::string out = option.kind == ValueKind::file ? " -F" : " -f";
  std::string words = detail::joined(detail::offered_values(option), " ");
  if (option.kind == ValueKind::folder) words += " (__fish_complete_directories)";
  if (!words.empty()) out += " -a " + quoted(words);
  return out;
}

std::string lines_of(const std::string& program, const std::string& path,
                     const CommandDescription& command) {
  const std::string at = fmt::format("complete -c {} -n '__{}_at {}'", program, program, path);
  std::string out;
  for (const CommandDescription& below : command.commands) {
    out += fmt::format("{} -a {} -d {}\n", at, below.name, quoted(detail::short_text(below.text)));
  }
  for (const OptionDescription& option : command.options) {
    const std::string text = " -d " + quoted(detail::short_text(option.text));
    if (option.positional) {
      const std::string value = value_of(option);
      if (value != " -f") out += at + value + text + "\n";
      continue;
    }
    out += at;
    for (const std::string& name : option.names) {
      out += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
    }
    if (option.takes_value) out += " -r" + value_of(option);
    out += text + "\n";
  }
  return out;
}

}  // namespace

std::string fish_completion(const CommandDescription& program) {
  std::string paths;
  std::string lines;
  detail::visit_commands(program, [&](const std::string& path, const CommandDescription& command) {
    if (path != program.name) paths += " " + quoted(path);
    lines += lines_of(program.name, path, command);
  });
  return fmt::format(
      "# Completion of {0} in fish. The script is made by `{0} completion fish`.\n"
      "\n"
      "# Says whether the words before the cursor are those of the command in the arguments.\n"
      "function __{0}_at\n"
      "    set -l path {0}\n"
      "    for word in (commandline -opc)[2..-1]\n"
      "        if contains -- \"$path $word\"{1}\n"
      "            set path \"$path $word\"\n"
      "        end\n"
      "    end\n"
      "    test \"$path\" = \"$argv\"\n"
      "end\n"
      "\n"
      "complete -c {0} -f\n"
      "{2}",
      program.name, paths, lines);
}

}  // namespace emit::tool
