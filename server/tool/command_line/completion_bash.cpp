// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "tool/command_line/completion.hpp"

namespace emit::tool {
namespace {

using detail::joined;
using detail::offered_values;

/// The last part of the script, which does not depend on the commands. It follows the words before
/// the cursor down the tree of commands; the tables above it say what each of them takes.
constexpr const char* kWalk = R"(
@complete() {
  local current=${COMP_WORDS[COMP_CWORD]} command=@name position=0 skip='' index word
  local kind='' words='' commands='' options=''
  for ((index = 1; index < COMP_CWORD; ++index)); do
    word=${COMP_WORDS[index]}
    if [[ -n $skip ]]; then
      # Bash splits --option=value at the equals sign.
      [[ $word == '=' ]] || skip=''
    elif [[ $word == -* ]]; then
      @value "$command $word" && skip=1
    elif @command "$command $word"; then
      command="$command $word"
      position=0
    else
      position=$((position + 1))
    fi
  done
  [[ $current == '=' ]] && current=''
  if [[ -z $skip ]]; then
    kind='' words=''
    @words "$command"
    if [[ $current == -* ]]; then
      words=$options
    else
      @argument "$command $position"
      words="$commands $words"
      [[ -n $kind || -n ${words// /} ]] || words=$options
    fi
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
  case $kind in
    file) mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -f -- "$current") ;;
    folder) mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -d -- "$current") ;;
  esac
  [[ -n $kind ]] && compopt -o filenames 2>/dev/null
  return 0
}
complete -F @complete @name
)";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at)) {
    text.replace(at, from.size(), to);
    at += to.size();
  }
  return text;
}

/// Shell assignments that say what a value is.
std::string value_of(const OptionDescription& option) {
  const char* kind = option.kind == ValueKind::file     ? "file"
                     : option.kind == ValueKind::folder ? "folder"
                                                        : "";
  return fmt::format("kind='{}' words='{}'", kind, joined(offered_values(option), " "));
}

/// The four tables of the script, as the arms of a `case`.
struct Tables {
  std::string commands;   ///< which words go down the tree
  std::string words;      ///< commands and options of a command
  std::string values;     ///< what the value of an option is
  std::string arguments;  ///< what a positional argument is, by its position from 0
};

void add_command(const std::string& path, const CommandDescription& command, Tables& out) {
  std::vector<std::string> below;
  for (const CommandDescription& each : command.commands) {
    below.push_back(each.name);
    out.commands += fmt::format("    '{} {}') return 0 ;;\n", path, each.name);
  }
  std::vector<std::string> options;
  std::size_t position = 0;
  for (const OptionDescription& option : command.options) {
    if (option.positional) {
      // The last argument of a list may be given again and again.
      const std::string where = option.repeatable ? "*" : std::to_string(position);
      out.arguments += fmt::format("    '{} '{}) {} ;;\n", path, where, value_of(option));
      ++position;
      continue;
    }
    for (const std::string& name : option.names) {
      options.push_back(name);
      if (!option.takes_value) continue;
      out.values += fmt::format("    '{} {}') {} ;;\n", path, name, value_of(option));
    }
  }
  out.words += fmt::format("    '{}') commands='{}' options='{}' ;;\n", path, joined(below, " "),
                           joined(options, " "));
}

std::string function(const std::string& name, const std::string& text, const std::string& arms,
                     const char* otherwise) {
  return fmt::format("\n# {}\n{}() {{\n  case $1 in\n{}    *) return {} ;;\n  esac\n}}\n", text,
                     name, arms, otherwise);
}

}  // namespace

std::string bash_completion(const CommandDescription& program) {
  Tables tables;
  detail::visit_commands(program,
                         [&tables](const std::string& path, const CommandDescription& command) {
                           add_command(path, command, tables);
                         });
  const std::string prefix = "_" + program.name;
  std::string out = fmt::format(
      "# Completion of {0} in bash. The script is made by `{0} completion bash`.\n", program.name);
  out +=
      function(prefix + "_command", "Says whether the words are a command.", tables.commands, "1");
  out += function(prefix + "_words", "Sets commands and options of a command.", tables.words, "1");
  out +=
      function(prefix + "_value", "Sets what the value of an option is; 1: the option takes none.",
               tables.values, "1");
  out += function(prefix + "_argument", "Sets what the argument at a position is.",
                  tables.arguments, "0");
  std::string walk = kWalk;
  for (const char* name : {"command", "words", "value", "argument", "complete"}) {
    walk = replaced(walk, fmt::format("@{}", name), fmt::format("{}_{}", prefix, name));
  }
  return out + replaced(walk, "@name", program.name);
}

}  // namespace emit::tool
