// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "resolve/resolve.hpp"

namespace emit::config {
namespace {

/// True when a file with these sections may have `key` on its first level.
bool is_root_key(const std::vector<SectionDoc>& sections, std::string_view key) {
  return std::ranges::any_of(sections, [key](const SectionDoc& section) {
    if (!section.path.empty()) return section.path == key;
    return std::ranges::any_of(section.rows,
                               [key](const SectionDoc::Row& row) { return row.spec.name == key; });
  });
}

}  // namespace

std::string place_of_scenario_key(std::string_view key) {
  if (!is_root_key(scenario_sections(), key)) return {};
  return "belongs to the scenario file that 'scenario' names";
}

std::string place_of_daemon_key(std::string_view key) {
  if (!is_root_key(daemon_sections(), key)) return {};
  return "belongs to the configuration of the daemon (emitd --config)";
}

FileKind kind_of(const Node& root) {
  const auto all = [&root](const auto& is_known) {
    return !root.members.empty() && std::ranges::all_of(root.members, [&](const Member& member) {
      return is_known(member.key);
    });
  };
  if (all([](std::string_view key) { return key == "material"; })) return FileKind::materials;
  if (all([](std::string_view key) { return is_root_key(scenario_sections(), key); })) {
    return FileKind::scenario;
  }
  if (all([](std::string_view key) { return is_root_key(daemon_sections(), key); })) {
    return FileKind::daemon;
  }
  return FileKind::unknown;
}

FileKind kind_of_file(const std::filesystem::path& file) {
  const physics::Result<Node> root = parse_toml_file(file);
  return root ? kind_of(*root) : FileKind::unknown;
}

}  // namespace emit::config
