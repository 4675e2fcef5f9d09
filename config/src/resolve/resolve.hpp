// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "emit/config/daemon_config.hpp"
#include "emit/config/load.hpp"
#include "keys/keys.hpp"
#include "tables/tables.hpp"

/// Second half of loading a scenario: drafts become plain descriptions, combinations are checked.
/// Every function reports faults to `diagnostics` at the node that says what is wrong.
namespace emit::config {

/// The material tables of the scenario and its libraries as one list of nodes, libraries first.
[[nodiscard]] std::vector<Node> collect_material_nodes(
    const Node& root, const std::vector<std::filesystem::path>& libraries,
    Diagnostics& diagnostics);
[[nodiscard]] std::vector<scene::Material> resolve_materials(
    const std::vector<Node>& nodes, const std::vector<std::string>& known_bands,
    Diagnostics& diagnostics);

/// Names of the built-in bands and of `declared`.
[[nodiscard]] std::vector<std::string> known_band_names(
    const std::vector<scene::SpectralBand>& declared);
[[nodiscard]] std::vector<scene::SpectralBand> resolve_declared_bands(const Node& root,
                                                                      Diagnostics& diagnostics);
[[nodiscard]] std::vector<scene::ChannelDesc> resolve_channels(
    const Node& root, const std::vector<std::string>& known_bands, Diagnostics& diagnostics);
/// Against the sensor's format; and one channel shows every frame.
void check_channel_windows(const Node& root, const scene::ScenarioDesc& scenario,
                           Diagnostics& diagnostics);
/// The bands channels use, in their order, then the declared ones that none uses.
[[nodiscard]] std::vector<scene::SpectralBand> bands_in_use(
    const std::vector<scene::ChannelDesc>& channels,
    const std::vector<scene::SpectralBand>& declared);
[[nodiscard]] scene::AtmosphereDesc resolve_atmosphere(
    const Node& root, const std::vector<scene::SpectralBand>& bands, Diagnostics& diagnostics);
/// Terms of a built-in model for a built-in band.
[[nodiscard]] std::optional<scene::BandAtmosphere> model_atmosphere(const std::string& model,
                                                                    const std::string& band);

[[nodiscard]] std::vector<scene::ObjectDesc> resolve_objects(
    const Node& root, const std::vector<scene::Material>& materials, bool require_files,
    Diagnostics& diagnostics);
[[nodiscard]] scene::SensorDesc resolve_sensor(const Node& root, Diagnostics& diagnostics);

/// host:port with a port of 0..65535; IPv6 addresses stand in brackets.
[[nodiscard]] bool is_endpoint(std::string_view text);
/// Reports ports that other hosts may reach unprotected, and TLS that is half configured.
void check_access(const Node& root, const DaemonConfig& daemon, Diagnostics& diagnostics);

/// The sub-table of the root, or an empty one.
[[nodiscard]] const Node& section(const Node& root, std::string_view name,
                                  Diagnostics& diagnostics);
/// The array of tables of the root; empty when absent or of another kind (reported).
[[nodiscard]] const std::vector<Node>& section_array(const Node& root, const std::string& name,
                                                     Diagnostics& diagnostics);
/// `key` in `table`, else the table itself: where a message about the key points.
[[nodiscard]] const Location& key_location(const Node& table, std::string_view key) noexcept;
/// Reports the lines of an error of a named file: a missing file at the key that names it, faults
/// inside it at their own place.
void report_file_error(const physics::Error& error, const Node& table, std::string_view key,
                       Diagnostics& diagnostics);

}  // namespace emit::config
