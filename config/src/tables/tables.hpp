// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

/// Readers of the CSV files that a scenario names.
namespace emit::config {

// load_tables.cpp: CSV files.
[[nodiscard]] physics::Result<std::vector<scene::WeatherSample>> load_weather_csv(
    const std::filesystem::path& file);
[[nodiscard]] physics::Result<scene::Trajectory> load_trajectory_csv(
    const std::filesystem::path& file);
[[nodiscard]] physics::Result<std::vector<scene::ResponseSample>> load_response_csv(
    const std::filesystem::path& file);

// load_atmosphere.cpp: tables or terms, told apart by the header row.
[[nodiscard]] physics::Result<std::vector<scene::BandAtmosphere>> load_atmosphere_csv(
    const std::filesystem::path& file, const std::vector<std::string>& known_bands);

}  // namespace emit::config
