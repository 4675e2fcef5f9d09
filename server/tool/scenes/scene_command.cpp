// SPDX-License-Identifier: Apache-2.0
#include "tool/scenes/scene_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "emit/config/load.hpp"
#include "emit/physics/constants.hpp"
#include "emit/scenegen/generate.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/offline/preview.hpp"
#include "tool/offline/time_options.hpp"
#include "tool/scenes/preview_sheet.hpp"
#include "tool/scenes/scenario_file.hpp"
#include "tool/scenes/scene_check.hpp"
#include "tool/scenes/scene_skeleton.hpp"
#include "tool/scenes/terrain_command.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

struct NewOptions {
  std::filesystem::path model;
  std::filesystem::path out;
  SkeletonOptions skeleton;
  double ground_m = 0.0;  ///< 0: twenty times the model
  double length_m = 0.0;  ///< of the model's longest side; 0: as the file says
  bool no_ground = false;
};

struct CheckOptions {
  ScenarioChoice input;
  std::optional<std::filesystem::path> json;
};

struct PreviewOptions {
  ScenarioChoice input;
  TimeChoice times;
  std::filesystem::path out;
  std::vector<std::string> bands;
  std::string focus;
  std::string quality = "preview";
  std::uint32_t width_px = 320;
  std::uint32_t height_px = 256;
  int gpu_index = -1;
};

/// Name of a file as a scenario in `folder` gives it: relative where it lies in the folder.
std::string name_from(const std::filesystem::path& folder, const std::filesystem::path& file) {
  std::error_code ignored;
  const auto whole = std::filesystem::absolute(file, ignored).lexically_normal();
  const auto relative =
      whole.lexically_relative(std::filesystem::absolute(folder, ignored).lexically_normal());
  return relative.empty() || *relative.begin() == ".." ? whole.string() : relative.string();
}

/// Writes the ground where one is wanted, and puts it into the skeleton.
Result<void> make_ground(const NewOptions& command, double largest_m, SkeletonOptions& skeleton) {
  if (command.no_ground) return {};
  constexpr double kWide = 20.0;
  const double edge_m = command.ground_m > 0.0 ? command.ground_m : kWide * largest_m;
  const auto file = command.out / "ground.glb";
  const auto made = scenegen::generate_ground(file, edge_m, skeleton.ground_material);
  if (!made) return tl::unexpected(made.error());
  skeleton.ground_gltf = "ground.glb";
  fmt::print("{}: {:.3g} x {:.3g} m of {}\n", file.string(), edge_m, edge_m,
             skeleton.ground_material);
  return {};
}

void print_materials(const std::vector<SkeletonMaterial>& materials) {
  TextTable table({"glTF material", "share", "material", "because"});
  for (const SkeletonMaterial& each : materials) {
    table.add({each.gltf_material.empty() ? "(none)" : each.gltf_material,
               fmt::format("{:.1f} %", 100.0 * each.area_frac),
               each.guess.material.empty() ? "default" : each.guess.material,
               each.guess.exact              ? "the library has this name"
               : each.guess.material.empty() ? "nothing in the name says what it is"
                                             : fmt::format("guessed by '{}'", each.guess.word)});
  }
  fmt::print("{}", table.to_string());
}

int run_new(const NewOptions& command) {
  const std::vector<scene::Material> library = material_library();
  const auto model = scene::inspect_gltf(command.model, library);
  if (!model) return fail(model.error());
  if (model->bounds_body.empty()) return fail(kExitFailure, "the model has no triangles");
  for (const std::string& text :
       {command.skeleton.ground_material, command.skeleton.default_material}) {
    if (std::ranges::find(library, text, &scene::Material::name) == library.end()) {
      return fail(kExitUsage, fmt::format("the library has no material '{}'", text));
    }
  }
  SkeletonOptions skeleton = command.skeleton;
  if (skeleton.name.empty()) skeleton.name = command.model.stem().string();
  skeleton.gltf = name_from(command.out, command.model);
  const auto file = command.out / (skeleton.name + ".toml");
  if (auto done = check_new_file(file); !done) return fail(done.error());
  if (auto made = make_directory(command.out); !made) return fail(made.error());
  const scene::Aabb& box = model->bounds_body;
  const double largest_m =
      std::max({box.max_m.x - box.min_m.x, box.max_m.y - box.min_m.y, box.max_m.z - box.min_m.z});
  skeleton.scale = command.length_m > 0.0 ? command.length_m / largest_m : likely_scale(largest_m);
  skeleton.scale_is_guessed = !(command.length_m > 0.0);
  if (auto made = make_ground(command, skeleton.scale * largest_m, skeleton); !made) {
    return fail_call(made.error());
  }
  const std::vector<SkeletonMaterial> materials = skeleton_materials(*model, library);
  // Write the file, load it, and write it again with the air that place and date give.
  for (int round = 0; round < 2; ++round) {
    if (auto done = write_text_file(file, skeleton_text(*model, materials, skeleton)); !done) {
      return fail(done.error());
    }
    const auto scenario = config::load_scenario(file);
    if (!scenario) {
      return fail(kExitFailure,
                  fmt::format("the scenario does not load: {}", scenario.error().text));
    }
    skeleton.weather = {scenario->clear_sky.air_mean_k, scenario->clear_sky.dew_point_k};
  }
  print_materials(materials);
  if (skeleton.scale != 1.0 && skeleton.scale_is_guessed) {
    warn(
        fmt::format("the model is {:.4g} m long: scale = {:g} is set; review it, or give its "
                    "true length with --length-m",
                    largest_m, skeleton.scale));
  }
  fmt::print(
      "{}: review the materials, then `emit scene check {}` and `emit scene preview {} --out "
      "sheet.png`\n",
      file.string(), file.string(), file.string());
  return kExitOk;
}

int run_check(const CheckOptions& command) {
  const auto scenario = load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  const auto report = check_scene(*scenario);
  if (!report) return fail_config(report.error());
  std::FILE* out = text_stream(command.json);
  TextTable table({"object", "east m", "north m", "up m", "lowest m", "triangles"});
  for (const ObjectFigures& object : report->objects) {
    table.add({object.name, fmt::format("{:.3f}", object.east_m),
               fmt::format("{:.3f}", object.north_m), fmt::format("{:.3f}", object.up_m),
               fmt::format("{:.3f}", object.lowest_m), fmt::format("{}", object.triangles)});
  }
  fmt::print(out, "{}", table.to_string());
  for (const SceneFinding& finding : report->findings) {
    fmt::print(out, "{}: {}{}\n", finding.kind, finding.object.empty() ? "" : finding.object + ": ",
               finding.text);
  }
  fmt::print(out, "{}\n",
             report->findings.empty()
                 ? "nothing is doubtful"
                 : fmt::format("{} points to look at", report->findings.size()));
  if (command.json) {
    Json json = Json::object();
    Json findings = Json::array();
    for (const SceneFinding& finding : report->findings) {
      Json one = Json::object();
      one.set("kind", finding.kind).set("object", finding.object).set("text", finding.text);
      findings.push(std::move(one));
    }
    json.set("findings", std::move(findings));
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  return report->findings.empty() ? kExitOk : kExitFailure;
}

/// Morning, noon and night by the sun, on the first day that has an hour of history before them.
std::vector<double> default_times(const scene::ScenarioDesc& scenario) {
  constexpr double kDayS = 86'400.0;
  const double epoch_s = 1e-9 * static_cast<double>(scenario.epoch_utc_ns);
  const double solar_s = epoch_s + scenario.place.lon_rad / physics::kDegree * 240.0;
  const double midnight_s = -std::fmod(std::fmod(solar_s, kDayS) + kDayS, kDayS);
  std::vector<double> times_s;
  for (const double hour : {7.0, 13.0, 22.0}) {
    double time_s = std::round((midnight_s + 3600.0 * hour) / 60.0) * 60.0;
    while (time_s < 1e-9 * static_cast<double>(scenario.thermal.history_start_ns) + 3600.0) {
      time_s += kDayS;
    }
    times_s.push_back(time_s);
  }
  std::ranges::sort(times_s);
  return times_s;
}

int run_preview(const PreviewOptions& command) {
  ScenarioChoice input = command.input;
  if (command.quality == "preview") set_preview(input.set);
  const auto scenario = load_scenario_choice(input);
  if (!scenario) return fail_config(scenario.error());
  PreviewPlan plan;
  plan.focus = command.focus;
  plan.width_px = command.width_px;
  plan.height_px = command.height_px;
  plan.gpu_index = command.gpu_index;
  if (command.times.times_s.empty() && command.times.list.empty()) {
    plan.times_s = default_times(*scenario);
  } else {
    auto times_s = resolve_times(command.times, *scenario);
    if (!times_s) return fail_call(times_s.error());
    plan.times_s = std::move(*times_s);
  }
  constexpr std::size_t kMostTimes = 12;
  if (plan.times_s.size() > kMostTimes) {
    return fail(kExitUsage, fmt::format("a sheet has at most {} times", kMostTimes));
  }
  for (const std::string& name : command.bands) {
    const auto band = find_band(*scenario, name);
    if (!band) return fail_call(band.error());
    if (std::ranges::find(plan.bands, *band) == plan.bands.end()) plan.bands.push_back(*band);
  }
  for (std::size_t b = 0;
       command.bands.empty() && b < std::min<std::size_t>(scenario->bands.size(), 2); ++b) {
    plan.bands.push_back(b);
  }
  if (plan.bands.empty()) return fail(kExitConfig, "the scenario has no band");
  if (command.quality == "preview") fmt::print("{}", kPreviewText);
  const InterruptGuard interrupt;
  if (auto done = write_preview_sheet(*scenario, plan, command.out); !done) {
    return fail_call(done.error());
  }
  fmt::print("{}: 4 views, {} bands, {} times\n", command.out.string(), plan.bands.size(),
             plan.times_s.size());
  return kExitOk;
}

void add_new_options(CommandLine& line, NewOptions& options) {
  line.path("model", options.model, "glTF 2.0 file (.glb or .gltf)").required();
  line.output_folder("--out", options.out, "Folder for NAME.toml and ground.glb").required();
  line.option("--name", options.skeleton.name, "Name of scenario and object; default: the file's")
      .type_name("NAME");
  line.option("--lat-deg", options.skeleton.lat_deg, "Latitude, north positive")
      .in_range(-90.0, 90.0)
      .show_default();
  line.option("--lon-deg", options.skeleton.lon_deg, "Longitude, east positive")
      .in_range(-180.0, 180.0)
      .show_default();
  line.option("--height-m", options.skeleton.height_m, "Height of the place")
      .in_range(-500.0, 9000.0)
      .show_default();
  line.option("--epoch", options.skeleton.epoch_utc,
              "Instant of simulation time 0, RFC 3339 with offset")
      .type_name("INSTANT")
      .show_default();
  line.option("--default-material", options.skeleton.default_material,
              "Library material of what no name tells")
      .type_name("MATERIAL")
      .show_default();
  line.option("--length-m", options.length_m,
              "Length of the model's longest side; 0: as the file says, or by another unit of "
              "length where that is unlikely")
      .in_range(0.0, 1e5)
      .show_default();
  line.option("--ground", options.skeleton.ground_material, "Library material of the ground")
      .type_name("MATERIAL")
      .show_default();
  line.option("--ground-m", options.ground_m, "Edge of the ground; 0: twenty times the model")
      .in_range(0.0, 1e5)
      .show_default();
  line.flag("--no-ground", options.no_ground, "The model brings its own ground");
}

void add_check_options(CommandLine& line, CheckOptions& options) {
  add_scenario(line, options.input, "scenario");
  add_json(line, options.json);
}

void add_preview_options(CommandLine& line, PreviewOptions& options) {
  add_scenario(line, options.input, "scenario");
  add_times(line, "emit scene preview", options.times,
            "repeatable; default: 07:00, 13:00 and 22:00 by the sun of the place");
  line.output_file("--out", options.out, "PNG file to write").required();
  line.option("--band", options.bands, "Band; repeatable; default: the first two")
      .repeatable()
      .type_name("NAME");
  line.option("--focus", options.focus, "Object in the middle; default: all but flat ground")
      .type_name("OBJECT");
  line.option("--quality", options.quality, "As of emit render")
      .one_of({"full", "preview"})
      .show_default();
  line.option("--width", options.width_px, "Width of one picture, px")
      .in_range(64U, 2048U)
      .show_default();
  line.option("--height", options.height_px, "Height of one picture, px")
      .in_range(64U, 2048U)
      .show_default();
  add_gpu(line, options.gpu_index);
}

}  // namespace

void add_scene(CommandLine& tool) {
  CommandLine scene = tool.group({.name = "scene",
                                  .text = "Make, check and preview scenes from glTF models and "
                                          "elevation models",
                                  .example = "emit scene new truck.glb --out truck"});
  scene.command<NewOptions>(
      {.name = "new",
       .text = "Write a scenario for a model, with materials guessed by name and listed for review",
       .example = "emit scene new truck.glb --out truck"},
      add_new_options, run_new);
  scene.command<CheckOptions>(
      {.name = "check",
       .text = "Look for wrong units and axes, gaps to the ground, unmapped materials and faces "
               "that look inwards; exits 1 where something is doubtful",
       .example = "emit scene check truck/truck.toml"},
      add_check_options, run_check);
  scene.command<PreviewOptions>({.name = "preview",
                                 .text = "Render a sheet of four views, two bands and three times",
                                 .example = "emit scene preview truck/truck.toml --out sheet.png"},
                                add_preview_options, run_preview);
  add_terrain(scene);
}

}  // namespace emit::tool
