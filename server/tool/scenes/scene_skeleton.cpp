// SPDX-License-Identifier: Apache-2.0
#include "tool/scenes/scene_skeleton.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <string_view>

#include "tool/scenes/scenario_file.hpp"

namespace emit::tool {
std::vector<SkeletonMaterial> skeleton_materials(const scene::SceneSummary& model,
                                                 std::span<const scene::Material> library) {
  double sum_m2 = 0.0;
  for (const auto& row : model.materials) sum_m2 += row.area_m2;
  std::vector<SkeletonMaterial> out;
  for (const auto& row : model.materials) {
    if (row.triangles == 0) continue;
    out.push_back({row.gltf_material, guess_material(row.gltf_material, library),
                   sum_m2 > 0.0 ? row.area_m2 / sum_m2 : 0.0});
  }
  std::ranges::stable_sort(out, std::greater{}, &SkeletonMaterial::area_frac);
  return out;
}

std::string skeleton_text(const scene::SceneSummary& model,
                          std::span<const SkeletonMaterial> materials,
                          const SkeletonOptions& options) {
  const scene::Aabb& box = model.bounds_body;  // x forward, y right, z down
  const double forward_m = options.scale * (box.max_m.x - box.min_m.x);
  const double right_m = options.scale * (box.max_m.y - box.min_m.y);
  const double up_m = options.scale * (box.max_m.z - box.min_m.z);
  const double radius_m = 0.5 * std::hypot(forward_m, right_m, up_m);
  std::string out = fmt::format(
      "# Made by `emit scene new`. Look at the comments, then: emit scene check, emit scene "
      "preview.\nname = {}\n"
      "epoch_utc = {}   # simulation time 0; an offset such as +02:00 may take the place of Z\n"
      "default_material = {}          # for glTF materials that nothing maps\n\n"
      "[place]\nlat_deg = {}\nlon_deg = {}\nheight_m = {}\n\n",
      toml_quoted(options.name), options.epoch_utc, toml_quoted(options.default_material),
      options.lat_deg, options.lon_deg, options.height_m);
  out +=
      "[weather]                      # clear sky; file = \"weather.csv\" takes a measured table\n";
  if (options.weather) {
    out += fmt::format(
        "air_mean_k = {:.1f}             # mean of the day: usual here at this date; REVIEW\n"
        "dew_point_k = {:.1f}\n",
        options.weather->air_mean_k, options.weather->dew_point_k);
  }
  out += "\n";
  if (!options.ground_gltf.empty()) {
    out += fmt::format(
        "[thermal]\nsurroundings_material = {}   # the land beyond the ground below\n\n",
        toml_quoted(options.ground_material));
    out += fmt::format("[[object]]\nname = \"ground\"\ngltf = {}\nmaterial = {}\n\n",
                       toml_quoted(options.ground_gltf), toml_quoted(options.ground_material));
  }
  // The model stands with its lowest point on the ground.
  out += fmt::format("[[object]]\nname = {}\ngltf = {}\n", toml_quoted(options.name),
                     toml_quoted(options.gltf));
  if (options.scale != 1.0) {
    out += fmt::format("scale = {}                    # {}\n", options.scale,
                       options.scale_is_guessed ? "guessed from its size: REVIEW"
                                                : "brings its longest side to the length wanted");
  }
  out += fmt::format(
      "position_m = [0.0, 0.0, {:.4f}]   # {:.3g} m long, {:.3g} m wide, {:.3g} m "
      "high\n",
      options.scale * box.max_m.z, forward_m, right_m, up_m);
  out += "heading_deg = 0.0              # its glTF +z looks north\n\n[object.material_map]\n";
  for (const SkeletonMaterial& each : materials) {
    if (each.gltf_material.empty()) continue;  // primitives without material take the default
    const std::string share = fmt::format("{:.0f} % of the surface", 100.0 * each.area_frac);
    if (each.guess.material.empty()) {
      out += fmt::format("# {} = \"?\"   # {}; nothing in the name says what it is: REVIEW\n",
                         toml_quoted(each.gltf_material), share);
    } else if (each.guess.exact) {
      out += fmt::format("{} = {}   # {}\n", toml_quoted(each.gltf_material),
                         toml_quoted(each.guess.material), share);
    } else {
      out +=
          fmt::format("{} = {}   # {}; guessed by '{}': REVIEW\n", toml_quoted(each.gltf_material),
                      toml_quoted(each.guess.material), share, each.guess.word);
    }
  }
  for (const scene::SceneSummary::MaterialRow& row : model.materials) {
    if (row.triangles == 0 || row.gltf_material.empty() || row.colours.size() < 2) continue;
    out += fmt::format(
        "\n# The image of {} shows several colours. These lines make materials of them:\n"
        "# [[object.material_images]]\n# material = {}\n# legend = {{",
        toml_quoted(row.gltf_material), toml_quoted(row.gltf_material));
    std::string_view comma;
    for (const auto& [colour, frac] : row.colours) {
      out += fmt::format("{} {} = \"?\"", comma, toml_quoted(colour));
      comma = ",";
    }
    out += " }\n";
  }
  // The camera stands in front, to the left, a little above.
  constexpr double kFovDeg = 30.0;
  const double away_m = 2.4 * radius_m / std::tan(0.5 * kFovDeg * 0.017453292519943295);
  const double middle_m = 0.5 * up_m;
  out += fmt::format(
      "\n[sensor]\nwidth_px = 640\nheight_px = 512\nfov_h_deg = {}\n"
      "position_m = [{:.3f}, {:.3f}, {:.3f}]\nlook_at_m = [0.0, 0.0, {:.3f}]\n",
      kFovDeg, -0.55 * away_m, 0.78 * away_m, middle_m + 0.3 * away_m, middle_m);
  return out;
}

}  // namespace emit::tool
