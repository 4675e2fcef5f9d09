// SPDX-License-Identifier: Apache-2.0
#include "tool/command_line/man_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <string_view>

namespace emit::tool {
namespace {

/// Text without what roff would take for its own language, for the inside of a line.
std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else {
      out += c;
    }
  }
  return out;
}

/// Lines of text. A point or an apostrophe at the start of a line would be a request.
std::string lines(std::string_view text) {
  std::string out;
  bool at_start = true;
  for (const char c : escaped(text)) {
    if (at_start && (c == '.' || c == '\'')) out += "\\&";
    out += c;
    at_start = c == '\n';
  }
  if (!out.ends_with('\n')) out += '\n';
  return out;
}

std::string bold(std::string_view text) {
  return fmt::format("\\fB{}\\fR", escaped(text));
}

std::string italic(std::string_view text) {
  return fmt::format("\\fI{}\\fR", escaped(text));
}

std::string upper(std::string text) {
  std::ranges::transform(text, text.begin(),
                         [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return text;
}

std::string value_of(const OptionDescription& option) {
  return option.value.empty() ? option.positional ? upper(option.names.front()) : "VALUE"
                              : option.value;
}

/// Form of an option or argument on a command line.
std::string usage(const OptionDescription& option) {
  std::string text;
  if (option.positional) {
    text = italic(value_of(option));
  } else {
    text = bold(option.names.back());
    if (option.takes_value) text += " " + italic(value_of(option));
  }
  if (!option.required) text = "[" + text + "]";
  if (option.repeatable) text += " ...";
  return text;
}

std::string synopsis(const CommandDescription& command, const std::string& typed) {
  std::string text = bold(typed);
  for (const OptionDescription& option : command.options) {
    if (option.positional) text += "\n" + usage(option);
  }
  for (const OptionDescription& option : command.options) {
    if (!option.positional) text += "\n" + usage(option);
  }
  if (!command.commands.empty()) text += "\n" + italic("COMMAND") + " ...";
  return text + "\n";
}

std::string head_of(const OptionDescription& option) {
  if (option.positional) return italic(value_of(option));
  std::string text;
  for (const std::string& name : option.names) text += (text.empty() ? "" : ", ") + bold(name);
  if (option.takes_value) text += " " + italic(value_of(option));
  return text;
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

std::string entry(const OptionDescription& option) {
  std::string text = fmt::format(".TP\n{}\n{}", head_of(option), lines(option.text));
  std::string facts;
  if (option.required) facts += "Required. ";
  if (!option.choices.empty()) facts += fmt::format("One of: {}. ", joined(option.choices));
  if (!option.default_text.empty()) facts += fmt::format("Default: {}. ", option.default_text);
  if (facts.empty()) return text;
  facts.pop_back();
  return text + ".br\n" + lines(facts);
}

std::string entries(const CommandDescription& command, bool positional) {
  std::string text;
  for (const OptionDescription& option : command.options) {
    if (option.positional == positional) text += entry(option);
  }
  return text;
}

std::string section(const char* title, const std::string& text) {
  return text.empty() ? "" : fmt::format(".SH {}\n{}", title, text);
}

void add_pages(const CommandDescription& command, const ManHeading& heading,
               std::vector<ManFile>& out) {
  const std::size_t own = out.size();
  out.emplace_back();
  ManHeading with_commands = heading;
  for (const CommandDescription& below : command.commands) {
    ManHeading inner{heading.title + "-" + below.name,
                     heading.command + " " + below.name,
                     heading.section,
                     heading.version,
                     {heading.title + "(1)"}};
    with_commands.see_also.push_back(inner.title + "(1)");
    add_pages(below, inner, out);
  }
  out[own] = {heading.title + ".1", man_page(command, with_commands)};
}

}  // namespace

std::string man_page(const CommandDescription& command, const ManHeading& heading) {
  std::string commands;
  for (const CommandDescription& below : command.commands) {
    commands += fmt::format(".TP\n{}\n{}", bold(below.name), lines(below.text));
  }
  std::string see_also;
  for (const std::string& page : heading.see_also) {
    const std::size_t bracket = page.find('(');
    see_also += fmt::format("{}{}{}", see_also.empty() ? "" : ",\n", bold(page.substr(0, bracket)),
                            page.substr(bracket));
  }
  if (!see_also.empty()) see_also += "\n";
  std::string out = fmt::format(
      ".\\\" This page is made from the program's own help.\n"
      ".TH \"{}\" {} \"\" \"{}\" \"emitd manual\"\n",
      upper(escaped(heading.title)), heading.section, escaped(heading.version));
  out += section("NAME", fmt::format("{} \\- {}", escaped(heading.title), lines(command.text)));
  // Lines break between options only, and words do not move apart.
  out += section("SYNOPSIS",
                 fmt::format(".nh\n.ad l\n{}.ad b\n.hy\n", synopsis(command, heading.command)));
  out += section("ARGUMENTS", entries(command, true));
  out += section("OPTIONS", entries(command, false));
  out += section("COMMANDS", commands);
  if (!command.footer.empty()) {
    out += section("NOTES", fmt::format(".nf\n{}.fi\n", lines(command.footer)));
  }
  out += section("SEE ALSO", see_also);
  return out;
}

std::vector<ManFile> man_pages(const CommandDescription& program, const std::string& version) {
  std::vector<ManFile> out;
  add_pages(program, {program.name, program.name, 1, version, {"emitd(8)"}}, out);
  return out;
}

}  // namespace emit::tool
