// SPDX-License-Identifier: Apache-2.0
#include "tool/scenes/terrain_scenario.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "tool/scenes/scenario_file.hpp"

namespace emit::tool {

glm::dvec3 terrain_view_m(const scenegen::Terrain& terrain, const glm::dvec3& eye_world_m,
                          double radius_m) {
  constexpr double kNearFrac = 0.1;
  constexpr double kFlat = 0.005;
  // The axis looks this far below the peak or the horizon, so that most of the picture is ground.
  constexpr double kBelow = 0.12;
  double best = kFlat;
  glm::dvec3 target = eye_world_m + 0.5 * radius_m * glm::dvec3(0.0, 1.0, -kBelow);
  for (const scenegen::TerrainTile& tile : terrain.tiles) {
    for (const scenegen::TerrainPart& part : tile.parts) {
      for (const glm::vec3& position_m : part.positions_m) {
        const glm::dvec3 point_m = tile.origin_world_m + glm::dvec3(position_m);
        const glm::dvec3 to_point_m = point_m - eye_world_m;
        const double distance_m = std::hypot(to_point_m.x, to_point_m.y);
        if (distance_m < kNearFrac * radius_m || distance_m > radius_m) continue;
        if (to_point_m.z <= best * distance_m) continue;
        best = to_point_m.z / distance_m;
        target = point_m - glm::dvec3(0.0, 0.0, kBelow * distance_m);
      }
    }
  }
  return target;
}

std::string terrain_scenario_text(const TerrainScenario& scenario) {
  std::string out = fmt::format(
      "# Made by `emit scene terrain`. {}\n"
      "name = {}\n"
      "epoch_utc = {}   # simulation time 0; an offset such as +02:00 may take the place of Z\n"
      "default_material = {}          # of the surroundings, beyond the terrain, too\n\n"
      "[place]                        # the origin of the world: east, north, up from here\n"
      "lat_deg = {:.9f}\nlon_deg = {:.9f}\nheight_m = {:.3f}\n\n",
      scenario.source, toml_quoted(scenario.name), scenario.epoch_utc,
      toml_quoted(scenario.material), scenario.lat_deg, scenario.lon_deg, scenario.height_m);
  out +=
      "[weather]                      # clear sky; file = \"weather.csv\" takes a measured table\n";
  if (scenario.weather) {
    out += fmt::format(
        "air_mean_k = {:.1f}             # mean of the day: usual here at this date; REVIEW\n"
        "dew_point_k = {:.1f}\n",
        scenario.weather->air_mean_k, scenario.weather->dew_point_k);
  }
  // Facets of terrain are large, so that most samples lie far from edges of shadows. Four samples a
  // vertex leave room for those that are not.
  constexpr std::uint64_t kSamplesPerVertex = 4;
  constexpr std::uint64_t kThousand = 1000;
  const std::uint64_t samples =
      std::max(200 * kThousand,
               (kSamplesPerVertex * scenario.vertices + kThousand - 1) / kThousand * kThousand);
  out += fmt::format(
      "\n[thermal]\n"
      "method = \"cached\"\n"
      "tolerance_k = 2.0              # smaller: sharper shadows of mountains, a longer warm-up\n"
      "max_samples = {}\n"
      "history_start_s = -14400.0     # four hours of sun and shadow before time 0\n"
      "spin_up_s = 172800.0           # two days of weather before that\n"
      "steps = 24\n"
      "spacing = \"geometric\"\n"
      "first_step_s = 60.0\n"
      "lateral = false                # heat does not flow sideways over facets of tens of "
      "metres\n\n",
      samples);
  if (scenario.weather) {
    constexpr double kColderK = 20.0;
    constexpr double kWarmerK = 25.0;
    out += fmt::format("[display]\nmin_k = {:.0f}\nmax_k = {:.0f}\n\n",
                       scenario.weather->air_mean_k - kColderK,
                       scenario.weather->air_mean_k + kWarmerK);
  }
  out += fmt::format("[[object]]\nname = \"terrain\"\ngltf = {}\n\n", toml_quoted(scenario.gltf));
  out += fmt::format(
      "[sensor]\nwidth_px = 640\nheight_px = 512\nfov_h_deg = 40.0\nnear_m = 1.0\n"
      "position_m = [{:.3f}, {:.3f}, {:.3f}]\nlook_at_m = [{:.3f}, {:.3f}, {:.3f}]\n",
      scenario.eye_world_m.x, scenario.eye_world_m.y, scenario.eye_world_m.z,
      scenario.look_at_world_m.x, scenario.look_at_world_m.y, scenario.look_at_world_m.z);
  return out;
}

}  // namespace emit::tool
