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

/// Readers of scenarios and daemon configurations. Setup only; any thread. The only global state is
/// the environment of the process, which is read once per call.
///
/// Order of precedence: defaults < file < EMIT_* environment < overrides (`--set`). The name of a
/// variable is the key in upper case with `_` for `.`: thermal.steps is EMIT_THERMAL_STEPS. An
/// EMIT_* variable that names no key of a scenario or a daemon is an error.
///
/// An override is "key=value". The value is read as TOML, and as plain text where that fails.
/// Elements of arrays of tables are addressed by index or name: `object[truck].scale=2`,
/// `material[0].base_k=290`. Relative paths in overrides and in the environment start at the
/// working directory, those in a file at that file's folder, and `share:` at the data folders.
namespace emit::config {

struct LoadOptions {
  /// glTF files have to exist. It is false where a scenario is examined without its geometry.
  bool require_scene_files = true;
  /// Entries "NAME=value" in place of the environment of the process.
  std::optional<std::vector<std::string>> environment;
};

/// Reads and checks a scenario. What is doubtful but no fault goes to ScenarioDesc::warnings.
/// Errors: `config` with one line per fault, "file:line:column: text"; `not_found` when the file
/// itself does not exist.
[[nodiscard]] physics::Result<scene::ScenarioDesc> load_scenario(
    const std::filesystem::path& file, std::span<const std::string> overrides = {},
    const LoadOptions& options = {});

/// Reads and checks a library of materials. Overrides address its materials alone
/// (`material[concrete].base_k=290`). Errors: config, with one line per fault; not_found.
[[nodiscard]] physics::Result<std::vector<scene::Material>> load_materials(
    const std::filesystem::path& file, std::span<const std::string> overrides = {});

/// Reads and checks the configuration of emitd. The scenario that it names is found, but not read.
/// Errors: as of load_scenario().
[[nodiscard]] physics::Result<DaemonConfig> load_daemon(const std::filesystem::path& file,
                                                        std::span<const std::string> overrides = {},
                                                        const LoadOptions& options = {});

/// Effective configuration as TOML with every key. Loading the text again gives the same values.
/// Tables from CSV files stand in the text.
[[nodiscard]] std::string print_scenario(const scene::ScenarioDesc& scenario);
[[nodiscard]] std::string print_daemon(const DaemonConfig& daemon);
/// Material as the table of a scenario or of a library, to paste there.
[[nodiscard]] std::string print_material(const scene::Material& material);

/// Key of an effective configuration, as `--set` takes it, and its value in the spelling of TOML.
struct ConfigValue {
  std::string key;
  std::string value;
};
/// Lists the keys of a text of print_scenario() or print_daemon(), in its order. Elements of arrays
/// of tables go by name where it is theirs alone (`object[truck].scale`), else by index.
[[nodiscard]] std::vector<ConfigValue> list_values(std::string_view printed);

/// Folders with shipped data in the order of search: EMIT_DATA_DIR, <executable>/../share/emit.
[[nodiscard]] std::vector<std::filesystem::path> data_directories();
/// First file `relative` (such as "scenarios/box.toml") in the data folders. Errors: not_found,
/// which names every place that was tried.
[[nodiscard]] physics::Result<std::filesystem::path> find_data_file(
    const std::filesystem::path& relative);
/// Path of a scenario by its path or by the name of a shipped one ("box"). Errors: not_found.
[[nodiscard]] physics::Result<std::filesystem::path> resolve_scenario(
    std::string_view name_or_path);
/// Names of the shipped scenarios, sorted.
[[nodiscard]] std::vector<std::string> shipped_scenarios();

/// Kind of a TOML file by the keys of its first level: all of them are keys of that kind.
enum class FileKind : std::uint8_t {
  unknown,    ///< no TOML file, or its keys are of no kind or of several
  scenario,   ///< what load_scenario() reads
  daemon,     ///< what load_daemon() reads
  materials,  ///< a library of materials, which a scenario names in `materials`
};
[[nodiscard]] FileKind kind_of_file(const std::filesystem::path& file);

/// Sorts overrides by the file whose keys they name. Unknown keys go to `daemon`, whose loader
/// reports them.
struct SplitOverrides {
  std::vector<std::string> daemon;
  std::vector<std::string> scenario;
};
[[nodiscard]] SplitOverrides split_overrides(std::span<const std::string> overrides);

/// The tables of config/README.md, made from the key table.
[[nodiscard]] std::string key_reference_markdown();

}  // namespace emit::config
