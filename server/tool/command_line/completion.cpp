// SPDX-License-Identifier: Apache-2.0
#include "tool/command_line/completion.hpp"

#include <algorithm>
#include <cctype>

namespace emit::tool::detail {
namespace {

void visit_below(const std::string& path, const CommandDescription& command,
                 const CommandVisitor& visit) {
  visit(path, command);
  for (const CommandDescription& below : command.commands) {
    visit_below(path + " " + below.name, below, visit);
  }
}

bool is_plain_word(std::string_view word) {
  return !word.empty() && std::ranges::all_of(word, [](unsigned char c) {
    return std::isalnum(c) != 0 ||
           std::string_view("_-.,:=+/@%").find(static_cast<char>(c)) != std::string_view::npos;
  });
}

}  // namespace

void visit_commands(const CommandDescription& program, const CommandVisitor& visit) {
  visit_below(program.name, program, visit);
}

std::vector<std::string> offered_values(const OptionDescription& option) {
  std::vector<std::string> out;
  for (const auto* values : {&option.choices, &option.suggestions}) {
    std::ranges::copy_if(*values, std::back_inserter(out), is_plain_word);
  }
  return out;
}

std::string short_text(std::string_view text) {
  constexpr std::size_t kLong = 70;
  text = text.substr(0, text.find('\n'));
  if (text.size() > kLong) text = text.substr(0, text.find_first_of(";:("));
  if (text.size() > kLong) text = text.substr(0, text.rfind(' ', kLong));
  while (text.ends_with(' ') || text.ends_with(',')) text.remove_suffix(1);
  return std::string(text);
}

std::string joined(const std::vector<std::string>& words, std::string_view between) {
  std::string out;
  for (const std::string& word : words) {
    if (!out.empty()) out += between;
    out += word;
  }
  return out;
}

}  // namespace emit::tool::detail
