// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <vector>

namespace emit::tool {

/// Kind of things that a value names, for completion in a shell.
enum class ValueKind : unsigned char { text, file, folder };

/// One option, flag or positional argument of a command, as --help shows it.
struct OptionDescription {
  std::vector<std::string>
      names;  ///< with dashes, short names first; a positional argument: its name without dashes
  bool positional = false;
  bool required = false;
  bool repeatable = false;           ///< may be given several times
  bool takes_value = true;           ///< false: a flag
  std::string value;                 ///< what the value is called, e.g. "FILE"
  std::string default_text;          ///< empty: none is shown
  std::vector<std::string> choices;  ///< the only values that are taken; empty: any
  /// Values that the machine has now, e.g. shipped scenarios; others are taken too.
  std::vector<std::string> suggestions;
  ValueKind kind = ValueKind::text;
  std::string text;
};

/// A command with its options and the commands below it. The root is the program itself. Man pages
/// and shell completions are made from it, so that they cannot say something else than --help.
struct CommandDescription {
  std::string name;
  std::string text;
  std::string footer;  ///< lines below the options in --help, e.g. the example
  std::vector<OptionDescription> options;
  std::vector<CommandDescription> commands;
};

}  // namespace emit::tool
