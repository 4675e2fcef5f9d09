// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

/// Reading scenarios and daemon configurations. Setup only; any thread; no global state but the
/// process environment, which is read once per call.
///
/// Order of precedence: defaults < file < EMIT_* environment < overrides (`--set`). Environment
/// names are the key in upper case with `_` for `.`: thermal.steps is EMIT_THERMAL_STEPS. Only
/// known keys are looked up; other EMIT_* variables are left alone.
///
/// Overrides are "key=value": the value is read as TOML, and as plain text where that fails.
/// Elements of arrays of tables are addressed by index or name: `object[truck].scale=2`,
/// `material[0].base_k=290`. Relative paths in overrides and in the environment start at the
/// working directory, those in a file at that file's folder, and `share:` at the data folders.
namespace emit::config {

struct LoadOptions {
  /// glTF files must exist. Off where a scenario is examined without its geometry.
  bool require_scene_files = true;
  /// "NAME=value" entries in place of the process environment.
  std::optional<std::vector<std::string>> environment;
};

/// Errors: `config` with one line per fault, "file:line:column: text", in file order as far as
/// they can be told apart; `not_found` when the file itself does not exist.
[[nodiscard]] physics::Result<scene::ScenarioDesc> load_scenario(
    const std::filesystem::path& file, std::span<const std::string> overrides = {},
    const LoadOptions& options = {});

/// The scenario named in the file is resolved (resolve_scenario) but not loaded.
[[nodiscard]] physics::Result<DaemonConfig> load_daemon(const std::filesystem::path& file,
                                                        std::span<const std::string> overrides = {},
                                                        const LoadOptions& options = {});

/// Effective configuration as TOML, every key written out. Loading the text again gives the same
/// values; tables read from CSV files are written inline.
[[nodiscard]] std::string print_scenario(const scene::ScenarioDesc& scenario);
[[nodiscard]] std::string print_daemon(const DaemonConfig& daemon);

/// Folders with shipped data, in order of search: EMIT_DATA_DIR, <executable>/../share/emit.
[[nodiscard]] std::vector<std::filesystem::path> data_directories();
/// First existing `relative` (such as "scenarios/box.toml") in the data folders. Errors: not_found
/// naming every place that was tried.
[[nodiscard]] physics::Result<std::filesystem::path> find_data_file(
    const std::filesystem::path& relative);
/// A path to an existing file, or the name of a shipped scenario ("box").
[[nodiscard]] physics::Result<std::filesystem::path> resolve_scenario(
    std::string_view name_or_path);
/// Names of the shipped scenarios, sorted.
[[nodiscard]] std::vector<std::string> shipped_scenarios();

/// Sorts overrides by the file whose keys they name; what fits neither goes to `daemon`, whose
/// loading then reports the unknown key.
struct SplitOverrides {
  std::vector<std::string> daemon;
  std::vector<std::string> scenario;
};
[[nodiscard]] SplitOverrides split_overrides(std::span<const std::string> overrides);

/// The tables of config/README.md, from the one key table.
[[nodiscard]] std::string key_reference_markdown();

}  // namespace emit::config
