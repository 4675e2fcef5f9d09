// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/inspect.hpp"
#include "emit/scene/scene_desc.hpp"
#include "tool/scenes/material_guess.hpp"

namespace emit::tool {

/// Air of a place on a clear day.
struct SkeletonWeather {
  double air_mean_k = 0.0;
  double dew_point_k = 0.0;
};

/// Place and time of a new scenario.
struct SkeletonOptions {
  std::string name;
  std::string gltf;  ///< as the file names it
  double lat_deg = 48.56;
  double lon_deg = 11.26;
  double height_m = 0.0;
  std::string epoch_utc = "2014-06-21T06:00:00Z";
  std::string ground_gltf;  ///< empty: no ground
  std::string ground_material = "asphalt";
  std::string default_material = "painted_metal";
  double scale = 1.0;
  bool scale_is_guessed = true;
  std::optional<SkeletonWeather> weather;  ///< none: the climate of the place
};

/// A glTF material with what was chosen for it.
struct SkeletonMaterial {
  std::string gltf_material;
  MaterialGuess guess;
  double area_frac = 0.0;  ///< share of the surface of the model
};

/// Returns the materials of a model with guesses, the largest surface first.
[[nodiscard]] std::vector<SkeletonMaterial> skeleton_materials(
    const scene::SceneSummary& model, std::span<const scene::Material> library);

/// Returns a scenario for a model as TOML: it stands on the ground at the origin, in front of a
/// camera that has it in its picture. Guessed materials carry a comment that asks for a review.
[[nodiscard]] std::string skeleton_text(const scene::SceneSummary& model,
                                        std::span<const SkeletonMaterial> materials,
                                        const SkeletonOptions& options);

}  // namespace emit::tool
