// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"
#include "keys/key.hpp"

/// Readers of the CSV files that a scenario names.
namespace emit::config {

/// Returns the wind, m/s, for which the model of the wind gives a film, clamped to the winds that
/// tables may have (load_tables.cpp).
[[nodiscard]] double wind_of_film_m_s(double film_w_m2_k);

// These are in load_tables.cpp. Times and wavelengths have to increase from row to row.
// Errors: those of read_typed_table(); config, naming the row.
[[nodiscard]] physics::Result<std::vector<scene::WeatherSample>> load_weather_csv(
    const std::filesystem::path& file);
[[nodiscard]] physics::Result<scene::Trajectory> load_trajectory_csv(
    const std::filesystem::path& file);
[[nodiscard]] physics::Result<std::vector<scene::ResponseSample>> load_response_csv(
    const std::filesystem::path& file);
/// The column beside the wavelengths is an emissivity, or a reflectance, which is 1 - emissivity.
[[nodiscard]] physics::Result<std::vector<scene::EmissivitySample>> load_emissivity_csv(
    const std::filesystem::path& file);

/// Wavelengths that curves may have, um.
inline const Range kWavelengthUm = between(0.2, 100);
/// Returns a hint for a wavelength that is more likely another unit: "; this looks like ...", or
/// an empty text.
[[nodiscard]] std::string wavelength_hint(double wavelength_um);

/// Reads the air of `bands` from a file: CSV as below with bands of `known_bands`, or output of
/// MODTRAN (tape7.hpp), which is integrated over those of `bands` that it covers.
[[nodiscard]] physics::Result<std::vector<scene::BandAtmosphere>> load_atmosphere(
    const std::filesystem::path& file, const std::vector<scene::SpectralBand>& bands,
    const std::vector<std::string>& known_bands);

/// Reads a table of the air or the terms of a model; the header row says which
/// (load_atmosphere.cpp).
[[nodiscard]] physics::Result<std::vector<scene::BandAtmosphere>> load_atmosphere_csv(
    const std::filesystem::path& file, const std::vector<std::string>& known_bands);

}  // namespace emit::config
