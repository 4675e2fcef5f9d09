// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "tool/command_line/command_description.hpp"

namespace emit::tool {

/// Completion scripts of a program for three shells. Each completes commands, options, values with
/// a fixed or suggested set, files and folders, as `option value` and as `option=value`.
[[nodiscard]] std::string bash_completion(const CommandDescription& program);
[[nodiscard]] std::string fish_completion(const CommandDescription& program);
[[nodiscard]] std::string zsh_completion(const CommandDescription& program);

namespace detail {

/// Calls `visit` for the program and every command below it. `path` is what is typed, e.g.
/// "emit bench paper".
using CommandVisitor = std::function<void(const std::string& path, const CommandDescription&)>;
void visit_commands(const CommandDescription& program, const CommandVisitor& visit);

/// Values that a shell offers, without those that a shell would not take as one plain word.
[[nodiscard]] std::vector<std::string> offered_values(const OptionDescription& option);

/// First line of a text, without what follows its first sentence or clause when it is long.
[[nodiscard]] std::string short_text(std::string_view text);

[[nodiscard]] std::string joined(const std::vector<std::string>& words, std::string_view between);

}  // namespace detail

}  // namespace emit::tool
