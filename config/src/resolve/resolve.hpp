// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "emit/config/daemon_config.hpp"
#include "emit/config/load.hpp"
#include "keys/keys.hpp"
#include "tables/tables.hpp"

/// Second half of loading a scenario: drafts become plain descriptions, and combinations of keys
/// are checked. Every function reports faults to `diagnostics` at the node that is wrong.
namespace emit::config {

/// Material tables of the libraries and of the scenario as one list, libraries first.
[[nodiscard]] std::vector<Node> collect_material_nodes(
    const Node& root, const std::vector<std::filesystem::path>& libraries,
    Diagnostics& diagnostics);
/// Reports emissivities that the facets of a gloss do not let through, in the built-in bands and
/// those that the scenario declares. The weather of the scenario is read already.
/// @param nodes  of the materials, in their order
void check_glosses(const std::vector<Node>& nodes, const scene::ScenarioDesc& scenario,
                   const std::vector<scene::SpectralBand>& declared,
                   const std::vector<scene::Material>& materials, Diagnostics& diagnostics);
[[nodiscard]] std::vector<scene::Material> resolve_materials(
    const std::vector<Node>& nodes, const std::vector<std::string>& known_bands,
    Diagnostics& diagnostics);

/// Fate of a band that a spectrum of emissivity does not reach.
enum class UncoveredBand : std::uint8_t {
  refuse,  ///< a fault
  skip,    ///< it stays without an emissivity of its own
};
/// Folds the spectra of materials: emissivities of the bands of `scenario` that the material does
/// not list, the total one unless it is stated, and their errors. Warns of errors, and of bands
/// that a spectrum covers in part. Bands, atmosphere, place and objects of the scenario are read
/// already.
/// @param nodes  of the materials, in their order
void fold_spectra(const std::vector<Node>& nodes, const scene::ScenarioDesc& scenario,
                  UncoveredBand uncovered, std::vector<scene::Material>& materials,
                  std::vector<std::string>& warnings, Diagnostics& diagnostics);

/// Names of the built-in bands and of `declared`.
[[nodiscard]] std::vector<std::string> known_band_names(
    const std::vector<scene::SpectralBand>& declared);
[[nodiscard]] std::vector<scene::SpectralBand> resolve_declared_bands(const Node& root,
                                                                      Diagnostics& diagnostics);
[[nodiscard]] std::vector<scene::ChannelDesc> resolve_channels(
    const Node& root, const std::vector<std::string>& known_bands, Diagnostics& diagnostics);
/// Checks that windows lie within the sensor's image, that outputs make sense and, where
/// `require_files` asks for it, that their files exist, and that one channel shows every frame.
void check_channels(const Node& root, const scene::ScenarioDesc& scenario, bool require_files,
                    Diagnostics& diagnostics);
/// The bands that channels use, in the order of channels.
[[nodiscard]] std::vector<scene::SpectralBand> bands_in_use(
    const std::vector<scene::ChannelDesc>& channels,
    const std::vector<scene::SpectralBand>& declared);
/// Bands that need no declaration.
[[nodiscard]] const std::vector<scene::SpectralBand>& built_in_bands();
/// Gives materials an emissivity in bands that they do not list: that of the listed built-in band
/// that is most like it, by overlap over union. A band that overlaps none keeps the material's
/// total emissivity.
void complete_band_emissivities(const std::vector<scene::SpectralBand>& bands,
                                std::vector<scene::Material>& materials);
/// The air of the bands of `scenario`. Place, date and weather of the scenario are those of the
/// built-in air.
[[nodiscard]] scene::AtmosphereDesc resolve_atmosphere(const Node& root,
                                                       const scene::ScenarioDesc& scenario,
                                                       Diagnostics& diagnostics);
/// Built-in air of a scenario. `model` is a climate or "auto"; nothing for "none".
[[nodiscard]] std::optional<physics::AirSpec> built_in_air(const AtmosphereDraft& draft,
                                                           const scene::ScenarioDesc& scenario);

/// Reports a name that no material has, with the nearest one.
void check_material_name(const std::string& name, const std::vector<scene::Material>& materials,
                         const Location& at, Diagnostics& diagnostics);
[[nodiscard]] std::vector<scene::ObjectDesc> resolve_objects(
    const Node& root, const std::vector<scene::Material>& materials, bool require_files,
    Diagnostics& diagnostics);
/// Reads the joints between bodies. Reports names that no object and no material has.
[[nodiscard]] std::vector<scene::ContactDesc> resolve_contacts(
    const Node& root, const std::vector<scene::ObjectDesc>& objects,
    const std::vector<scene::Material>& materials, Diagnostics& diagnostics);
/// Reads the variation of materials into `materials`. Reports materials and bands that do not
/// exist, wavelengths that do not fit each other, and changes that lead out of the range of a
/// material.
void resolve_clutter(const Node& root, const scene::ThermalOptions& thermal,
                     const std::vector<std::string>& known_bands,
                     std::vector<scene::Material>& materials, Diagnostics& diagnostics);
/// Reads clouds with structure, and gives the models of the clear sky the same cover and base.
/// Reports a thermal method that has none, wavelengths that do not fit each other, keys of
/// [weather] that say the same, and a drift without a direction. The weather of the scenario is
/// read already.
void resolve_clouds(const Node& root, scene::ScenarioDesc& scenario, Diagnostics& diagnostics);
/// Reads plumes, flares, smoke and fires. Reports objects, parts and bands that do not exist, and
/// more puffs than a frame may hold.
[[nodiscard]] scene::GasDesc resolve_gas(const Node& root,
                                         const std::vector<scene::ObjectDesc>& objects,
                                         const std::vector<std::string>& known_bands,
                                         Diagnostics& diagnostics);
[[nodiscard]] scene::SensorDesc resolve_sensor(const Node& root, Diagnostics& diagnostics);

/// Kind of a file by the keys of its first level, see kind_of_file().
[[nodiscard]] FileKind kind_of(const Node& root);
/// Returns where a key of the first level belongs that another kind of file has, for the message
/// about an unknown key; empty if no such file has it.
[[nodiscard]] std::string place_of_scenario_key(std::string_view key);
[[nodiscard]] std::string place_of_daemon_key(std::string_view key);

/// True for host:port with a port of 0..65535. IPv6 addresses stand in brackets.
[[nodiscard]] bool is_endpoint(std::string_view text);
/// Reports ports that other hosts may reach without protection, and incomplete TLS.
void check_access(const Node& root, const DaemonConfig& daemon, Diagnostics& diagnostics);

/// The sub-table of the root, or an empty one.
[[nodiscard]] const Node& section(const Node& root, std::string_view name,
                                  Diagnostics& diagnostics);
/// The array of tables of the root. It is empty when the key is absent or of another kind, which is
/// reported.
[[nodiscard]] const std::vector<Node>& section_array(const Node& root, const std::string& name,
                                                     Diagnostics& diagnostics);
/// Place that a message about the key points to: `key` in `table`, else the table itself.
[[nodiscard]] const Location& key_location(const Node& table, std::string_view key) noexcept;
/// Reports an error of a file at the key that names it. The error's own lines name places in the
/// file.
void report_file_error(const physics::Error& error, const Node& table, std::string_view key,
                       Diagnostics& diagnostics);

}  // namespace emit::config
