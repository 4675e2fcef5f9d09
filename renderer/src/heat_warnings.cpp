// SPDX-License-Identifier: Apache-2.0
#include "heat_warnings.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string_view>

namespace emit::renderer {
namespace {

/// Returns the warning that rain leaves materials dry, which names what it is due to.
std::string rain_warning(const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry,
                         std::span<const std::uint32_t> bare) {
  constexpr const char* kFrames = "frames within six hours of rain carry 'degraded'";
  const std::string file = scenario.file.string();
  if (scenario.thermal.model == scene::ThermalModel::emit2014) {
    return fmt::format(
        "{}: it rains, but thermal.model \"emit2014\" has no rain: everything stays dry, and {}",
        file, kFrames);
  }
  std::vector<std::string_view> names;
  for (const std::uint32_t m : bare) names.push_back(geometry.materials[m].name);
  return fmt::format(
      "{}: it rains, but '{}' state{} no 'water_store_mm': rain leaves them dry, and {}", file,
      fmt::join(names, "', '"), names.size() == 1 ? "s" : "", kFrames);
}

/// Returns warnings of what the method `per-frame` leaves out of the heat of a scene with the model
/// foster: roofs that keep rain off, and the speed of entities.
std::vector<std::string> per_frame_warnings(const scene::ScenarioDesc& scenario,
                                            const scene::SceneGeometry& geometry, bool rains) {
  std::vector<std::string> out;
  if (scenario.thermal.method != scene::ThermalMethod::per_frame ||
      scenario.thermal.model != scene::ThermalModel::foster) {
    return out;
  }
  const std::string file = scenario.file.string();
  if (rains && std::ranges::any_of(geometry.materials, [](const scene::Material& material) {
        return !scene::water_store_of(material).none();
      })) {
    out.push_back(fmt::format(
        "{}: thermal.method \"per-frame\" knows no roofs: rain wets all that looks up", file));
  }
  std::vector<std::string_view> moving;
  for (const scene::ObjectDesc& object : scenario.objects) {
    if (object.trajectory.size() > 1 || object.air_film.shape != physics::AirFilmShape::surface) {
      moving.push_back(object.name);
    }
  }
  if (!moving.empty()) {
    out.push_back(fmt::format(
        "{}: thermal.method \"per-frame\" gives '{}' the film of scenery in the wind, "
        "without {} own speed, recovery temperature and 'air_film'; \"cached\" has them",
        file, fmt::join(moving, "', '"), moving.size() == 1 ? "its" : "their"));
  }
  return out;
}

}  // namespace

void add_heat_warnings(const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry,
                       std::span<const std::uint32_t> bare, bool rains,
                       std::vector<std::string>& warnings) {
  if (!bare.empty() && rains) warnings.push_back(rain_warning(scenario, geometry, bare));
  for (std::string& warning : per_frame_warnings(scenario, geometry, rains)) {
    warnings.push_back(std::move(warning));
  }
}

}  // namespace emit::renderer
