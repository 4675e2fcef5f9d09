// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/reference/measured_plate.hpp"
#include "emit/scene/scene_desc.hpp"
#include "tool/logger/logger_file.hpp"

/// The ground that a logger stood on: a material of the library under the logger's weather.
namespace emit::tool {

struct GroundOptions {
  std::string material = "soil";
  std::filesystem::path library;  ///< empty: the shipped one
  std::optional<double> absorptance_frac;
  std::optional<double> emissivity_frac;
  std::optional<double> base_k;
};

struct MeasuredGround {
  scene::Material material;
  reference::PlateSetup setup;
  reference::PlateNumbers numbers;  ///< before any fit
  bool absorptance_measured = false;
  bool measured_evaporation = false;  ///< of dry ground: rows lose the record's latent heat
  std::vector<std::string> origins;   ///< where every number comes from
};

/// Returns the ground before any fit, and gives the record the temperature of the surface for its
/// emissivity. The absorptance is the option's, else what the record shows, else the material's.
/// The base is the option's, else the material's own; a base of the kind `ground` follows from the
/// record's place and date, or is the mean of its air without them.
/// Errors: those of config::load_materials(); invalid_argument, with the nearest name.
[[nodiscard]] physics::Result<MeasuredGround> measured_ground(const GroundOptions& options,
                                                              LoggerRecord& record);

/// Returns the material with fitted numbers in it. The film has no number in a material.
[[nodiscard]] scene::Material with_numbers(scene::Material material,
                                           const reference::PlateNumbers& numbers);

}  // namespace emit::tool
