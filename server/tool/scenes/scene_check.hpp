// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

/// A doubt about a scene that a modeller should look at.
struct SceneFinding {
  std::string kind;    ///< "units", "axes", "ground", "material", "faces", "camera" or "loader"
  std::string object;  ///< empty: the scene as a whole
  std::string text;    ///< one sentence with what to do
};

/// Figures of an object as it stands in the scene.
struct ObjectFigures {
  std::string name;
  double east_m = 0.0;
  double north_m = 0.0;
  double up_m = 0.0;
  double lowest_m = 0.0;  ///< height of its lowest point, world
  std::uint64_t triangles = 0;
};

/// Result of the check of a scene.
struct SceneReport {
  std::vector<ObjectFigures> objects;
  std::vector<SceneFinding> findings;
};

/// Checks a scenario's geometry: sizes that speak of centimetres or millimetres, models that lie on
/// their side, objects that float or are sunk, materials that nothing maps, faces that look
/// inwards, and a camera that sees nothing. Setup only. Errors: those of scene::load_scene() and
/// reference::RayScene::create().
[[nodiscard]] physics::Result<SceneReport> check_scene(const scene::ScenarioDesc& scenario);

/// Returns the factor that brings a size in another unit into a likely one: 0.01 or 0.001 for a
/// size of hundreds of metres, 100 or 1000 for one of millimetres, else 1. `largest_m` is the
/// longest side of an object that is no terrain.
[[nodiscard]] double likely_scale(double largest_m) noexcept;

}  // namespace emit::tool
