// SPDX-License-Identifier: Apache-2.0
#include "overrides.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>

namespace emit::config {

namespace {

struct Segment {
  std::string key;
  bool selected = false;
  std::string selector;  ///< index or name in brackets
};

/// Reads a path such as a.b[c].d. False when it is none.
bool parse_path(std::string_view text, std::vector<Segment>& out) {
  std::size_t i = 0;
  while (i < text.size()) {
    Segment segment;
    while (i < text.size() && text[i] != '.' && text[i] != '[') {
      segment.key += text[i++];
    }
    if (segment.key.empty()) {
      return false;
    }
    if (i < text.size() && text[i] == '[') {
      const std::size_t close = text.find(']', i);
      if (close == std::string_view::npos || close == i + 1) {
        return false;
      }
      segment.selected = true;
      segment.selector = std::string(text.substr(i + 1, close - i - 1));
      i = close + 1;
    }
    out.push_back(std::move(segment));
    if (i < text.size()) {
      if (text[i] != '.' || i + 1 == text.size()) {
        return false;
      }
      ++i;
    }
  }
  return !out.empty();
}

/// Names that select() takes.
std::vector<std::string> names_in(const Node& array) {
  std::vector<std::string> names;
  for (const Node& item : array.items) {
    for (const std::string_view name_key : {"name", "band"}) {
      const Node* name = item.find(name_key);
      if (name != nullptr && name->kind == Node::Kind::text) names.push_back(name->text);
    }
  }
  return names;
}

Node* select(Node& array, const std::string& selector) {
  std::size_t index = 0;
  const char* end = selector.data() + selector.size();
  if (const auto parsed = std::from_chars(selector.data(), end, index);
      parsed.ec == std::errc() && parsed.ptr == end) {
    return index < array.items.size() ? &array.items[index] : nullptr;
  }
  for (Node& item : array.items) {
    for (const std::string_view name_key : {"name", "band"}) {
      const Node* name = item.find(name_key);
      if (name != nullptr && name->kind == Node::Kind::text && name->text == selector) {
        return &item;
      }
    }
  }
  return nullptr;
}

void put(Node& root, const std::vector<Segment>& path, Node value, Diagnostics& diagnostics) {
  const Location at = value.at;
  Node* node = &root;
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (node->kind != Node::Kind::table) {
      diagnostics.add(at, fmt::format("'{}' is {}, which has no key '{}'", path[i - 1].key,
                                      kind_name(node->kind), path[i].key));
      return;
    }
    const bool last = i + 1 == path.size();
    Node* child = node->find(path[i].key);
    if (path[i].selected) {
      Node* element = child != nullptr && child->kind == Node::Kind::array
                          ? select(*child, path[i].selector)
                          : nullptr;
      if (element == nullptr) {
        diagnostics.add(
            at,
            fmt::format("there is no {}[{}]{}", path[i].key, path[i].selector,
                        child != nullptr ? did_you_mean(path[i].selector, names_in(*child)) : ""));
        return;
      }
      if (last) {
        *element = std::move(value);
        return;
      }
      node = element;
      continue;
    }
    if (last) {
      if (child != nullptr) {
        *child = std::move(value);
      } else {
        node->members.push_back({path[i].key, at, std::move(value)});
      }
      return;
    }
    if (child == nullptr) {
      Node table;
      table.at = at;
      node->members.push_back({path[i].key, at, std::move(table)});
      child = &node->members.back().value;
    }
    node = child;
  }
}

std::shared_ptr<const Source> working_directory_source(std::string name) {
  std::error_code code;
  return std::make_shared<const Source>(
      Source{std::move(name), std::filesystem::current_path(code)});
}

std::string environment_name(const std::string& section, const std::string& key) {
  std::string out = "EMIT_" + (section.empty() ? "" : section + ".") + key;
  for (char& c : out) {
    c = c == '.' ? '_' : static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  }
  return out;
}

struct EnvironmentKey {
  std::string name;  ///< EMIT_THERMAL_STEPS
  std::string path;  ///< thermal.steps
};

/// The keys of `sections` that a variable can set. Elements of arrays of tables have no names.
std::vector<EnvironmentKey> environment_keys(const std::vector<SectionDoc>& sections) {
  std::vector<EnvironmentKey> keys;
  for (const SectionDoc& section : sections) {
    if (section.array) continue;
    for (const SectionDoc::Row& row : section.rows) {
      if (row.spec.type == "array of tables") continue;
      keys.push_back({environment_name(section.path, row.spec.name),
                      section.path.empty() ? row.spec.name : section.path + "." + row.spec.name});
    }
  }
  return keys;
}

/// Variables that programs of this repository read themselves: the folder of the data files, and
/// settings of its tests and scripts.
constexpr std::array<std::string_view, 5> kOwnVariables{
    "EMIT_DATA_DIR", "EMIT_PEERS_DIR", "EMIT_SOAK_S", "EMIT_TIDY_JOBS", "EMIT_UPDATE_GOLDENS"};

/// A misspelt variable would otherwise change nothing without a word. One environment serves
/// scenario and daemon, so that the keys of both are known here.
void report_unknown_names(const std::vector<std::string>& entries, Diagnostics& diagnostics) {
  std::vector<EnvironmentKey> keys = environment_keys(scenario_sections());
  for (EnvironmentKey& key : environment_keys(daemon_sections())) keys.push_back(std::move(key));
  std::vector<std::string_view> known(kOwnVariables.begin(), kOwnVariables.end());
  for (const EnvironmentKey& key : keys) known.push_back(key.name);
  for (const std::string& entry : entries) {
    const std::string_view name = std::string_view(entry).substr(0, entry.find('='));
    if (!name.starts_with("EMIT_") || std::ranges::find(known, name) != known.end()) continue;
    const std::string_view near = physics::nearest_name(name, known);
    diagnostics.add({working_directory_source(std::string(name)), 0, 0},
                    near.empty()
                        ? std::string("unknown environment variable: no key has this name")
                        : fmt::format("unknown environment variable, did you mean {}?", near));
  }
}

const std::vector<std::string>& process_environment(std::vector<std::string>& store) {
  for (char** entry = environ; entry != nullptr && *entry != nullptr; ++entry) {
    if (std::string_view(*entry).substr(0, 5) == "EMIT_") {
      store.emplace_back(*entry);
    }
  }
  return store;
}

}  // namespace

void apply_environment(Node& root, const std::vector<SectionDoc>& sections,
                       const LoadOptions& options, Diagnostics& diagnostics) {
  std::vector<std::string> store;
  const std::vector<std::string>& entries =
      options.environment ? *options.environment : process_environment(store);
  const std::vector<EnvironmentKey> keys = environment_keys(sections);
  for (const std::string& entry : entries) {
    const std::string_view name = std::string_view(entry).substr(0, entry.find('='));
    const auto key = std::ranges::find(keys, name, &EnvironmentKey::name);
    if (key == keys.end() || name.size() == entry.size()) continue;
    std::vector<Segment> path;
    if (parse_path(key->path, path)) {
      put(root, path,
          parse_override_value(std::string_view(entry).substr(name.size() + 1),
                               working_directory_source(key->name)),
          diagnostics);
    }
  }
  report_unknown_names(entries, diagnostics);
}

void apply_override(Node& root, std::string_view text, Diagnostics& diagnostics) {
  const auto source = working_directory_source("--set " + std::string(text));
  // The key ends at the first '=' outside brackets.
  const std::size_t close = text.find(']');
  const std::size_t open = text.find('[');
  std::size_t equals = text.find('=');
  if (open != std::string_view::npos && close != std::string_view::npos && open < equals &&
      equals < close) {
    equals = text.find('=', close);
  }
  std::vector<Segment> path;
  if (equals == std::string_view::npos || !parse_path(text.substr(0, equals), path)) {
    diagnostics.add({source, 0, 0}, "expected key=value, such as thermal.steps=90");
    return;
  }
  put(root, path, parse_override_value(text.substr(equals + 1), source), diagnostics);
}

bool addresses_element_of(std::string_view text, std::string_view name) noexcept {
  return text.size() > name.size() && text.substr(0, name.size()) == name &&
         text[name.size()] == '[';
}

SplitOverrides split_overrides(std::span<const std::string> overrides) {
  const auto knows = [](const std::vector<SectionDoc>& sections, std::string_view first) {
    return std::any_of(sections.begin(), sections.end(), [first](const SectionDoc& section) {
      if (!section.path.empty()) {
        return section.path == first;
      }
      return std::any_of(section.rows.begin(), section.rows.end(),
                         [first](const SectionDoc::Row& row) { return row.spec.name == first; });
    });
  };
  SplitOverrides out;
  for (const std::string& text : overrides) {
    const std::string_view first = std::string_view(text).substr(0, text.find_first_of(".[="));
    const bool scenario = knows(scenario_sections(), first) && !knows(daemon_sections(), first);
    (scenario ? out.scenario : out.daemon).push_back(text);
  }
  return out;
}

}  // namespace emit::config
