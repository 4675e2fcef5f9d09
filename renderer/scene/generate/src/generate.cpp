// SPDX-License-Identifier: Apache-2.0
#include "emit/scenegen/generate.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <string>
#include <system_error>
#include <utility>

#include "airfield.hpp"
#include "glb_writer.hpp"
#include "sea.hpp"
#include "simple_scenes.hpp"
#include "statue.hpp"

namespace emit::scenegen {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr std::array<std::pair<SceneKind, std::string_view>, 6> kKindNames{
    {{SceneKind::box, "box"},
     {SceneKind::statue, "statue"},
     {SceneKind::block_on_road, "block-on-road"},
     {SceneKind::ribbed, "ribbed"},
     {SceneKind::airfield, "airfield"},
     {SceneKind::sea, "sea"}}};

/// Returns an error that names the option when `valid` is false. `value` may be NaN.
Result<void> require(bool valid, const char* option, double value, const char* rule) {
  if (valid) {
    return {};
  }
  return make_error(ErrorCode::invalid_argument,
                    fmt::format("option {} = {}: {}", option, value, rule));
}

Result<void> first_error(std::initializer_list<Result<void>> checks) {
  for (const Result<void>& check : checks) {
    if (!check) {
      return check;
    }
  }
  return {};
}

bool in_range(double value, double lo, double hi) {
  return value >= lo && value <= hi;
}

constexpr double kMaxLengthM = 1e5;

Result<void> check(const BoxOptions& o) {
  return first_error(
      {require(in_range(o.size_m, 1e-3, kMaxLengthM), "size_m", o.size_m,
               "must be in [0.001, 1e5]"),
       require(o.plane_m == 0.0 || (o.plane_m > 1.2 * o.size_m && o.plane_m <= kMaxLengthM),
               "plane_m", o.plane_m, "must be 0, or exceed 1.2 size_m and be at most 1e5")});
}

Result<void> check(const StatueOptions& o) {
  return first_error(
      {require(o.min_triangles >= 1000 && o.min_triangles <= 20'000'000, "min_triangles",
               o.min_triangles, "must be in [1000, 2e7]"),
       require(in_range(o.height_m, 0.1, 100.0), "height_m", o.height_m, "must be in [0.1, 100]"),
       require(o.plane_m == 0.0 || (o.plane_m > 2.0 * o.height_m && o.plane_m <= kMaxLengthM),
               "plane_m", o.plane_m, "must be 0, or exceed 2 height_m and be at most 1e5")});
}

Result<void> check(const BlockOnRoadOptions& o) {
  const double smallest = std::min({o.block_east_m, o.block_north_m, 2.0 * o.block_up_m});
  return first_error(
      {require(in_range(o.block_east_m, 1e-3, kMaxLengthM), "block_east_m", o.block_east_m,
               "must be in [0.001, 1e5]"),
       require(in_range(o.block_north_m, 1e-3, kMaxLengthM), "block_north_m", o.block_north_m,
               "must be in [0.001, 1e5]"),
       require(in_range(o.block_up_m, 1e-3, kMaxLengthM), "block_up_m", o.block_up_m,
               "must be in [0.001, 1e5]"),
       require(o.wall_thickness_m >= 0.0 && 2.0 * o.wall_thickness_m < smallest, "wall_thickness_m",
               o.wall_thickness_m, "must be 0 or leave a cavity"),
       require(o.road_east_m > o.block_east_m && o.road_east_m <= kMaxLengthM, "road_east_m",
               o.road_east_m, "must exceed the block and be at most 1e5"),
       require(o.road_north_m > o.block_north_m && o.road_north_m <= kMaxLengthM, "road_north_m",
               o.road_north_m, "must exceed the block and be at most 1e5")});
}

Result<void> check(const RibbedOptions& o) {
  return first_error(
      {require(o.ribs >= 1 && o.ribs <= 1000, "ribs", o.ribs, "must be in [1, 1000]"),
       require(in_range(o.pitch_m, 1e-3, kMaxLengthM), "pitch_m", o.pitch_m,
               "must be in [0.001, 1e5]"),
       require(o.rib_width_m > 0.0 && o.rib_width_m < o.pitch_m, "rib_width_m", o.rib_width_m,
               "must be in (0, pitch_m)"),
       require(in_range(o.rib_height_m, 1e-3, kMaxLengthM), "rib_height_m", o.rib_height_m,
               "must be in [0.001, 1e5]"),
       require(in_range(o.length_m, 1e-3, kMaxLengthM), "length_m", o.length_m,
               "must be in [0.001, 1e5]")});
}

Result<void> check(const GenerateOptions& options) {
  switch (options.kind) {
    case SceneKind::box:
      return check(options.box);
    case SceneKind::statue:
      return check(options.statue);
    case SceneKind::block_on_road:
      return check(options.block_on_road);
    case SceneKind::ribbed:
      return check(options.ribbed);
    case SceneKind::airfield:
    case SceneKind::sea:
      break;
  }
  return {};
}

using NamedScenes = std::vector<std::pair<std::string, Scene>>;

Result<NamedScenes> build(const GenerateOptions& options) {
  NamedScenes scenes;
  const std::string name(to_string(options.kind));
  switch (options.kind) {
    case SceneKind::box:
      scenes.emplace_back(name, box_scene(options.box));
      break;
    case SceneKind::statue: {
      Result<Scene> statue = statue_scene(options.statue);
      if (!statue) {
        return tl::unexpected(std::move(statue.error()));
      }
      scenes.emplace_back(name, std::move(*statue));
      break;
    }
    case SceneKind::block_on_road:
      scenes.emplace_back(name, block_on_road_scene(options.block_on_road));
      break;
    case SceneKind::ribbed:
      scenes.emplace_back(name, ribbed_scene(options.ribbed));
      break;
    case SceneKind::sea:
      scenes = sea_scenes();
      break;
    case SceneKind::airfield: {
      scenes = vehicle_scenes();
      Scene field;
      add_ground(field, options.airfield.seed);
      add_buildings(field);
      add_trees_and_fence(field, options.airfield.seed);
      scenes.emplace_back(name, std::move(field));
      break;
    }
  }
  return scenes;
}

}  // namespace

std::string_view to_string(SceneKind kind) noexcept {
  for (const auto& [value, name] : kKindNames) {
    if (value == kind) {
      return name;
    }
  }
  return "";
}

std::optional<SceneKind> scene_kind_from(std::string_view name) noexcept {
  for (const auto& [value, text] : kKindNames) {
    if (text == name) {
      return value;
    }
  }
  return std::nullopt;
}

Result<GeneratedFiles> generate(const GenerateOptions& options) {
  if (auto checked = check(options); !checked) {
    return tl::unexpected(std::move(checked.error()).with_context(to_string(options.kind)));
  }
  std::error_code status;
  std::filesystem::create_directories(options.directory, status);
  if (status) {
    return make_error(ErrorCode::io,
                      fmt::format("{}: {}", options.directory.string(), status.message()));
  }
  const Result<NamedScenes> scenes = build(options);
  if (!scenes) {
    return tl::unexpected(scenes.error());
  }
  GeneratedFiles files;
  for (const auto& [name, scene] : *scenes) {
    const Result<GeneratedFile> file = write_glb(options.directory / (name + ".glb"), scene);
    if (!file) {
      return tl::unexpected(file.error());
    }
    files.files.push_back(*file);
  }
  return files;
}

Result<GeneratedFile> generate_ground(const std::filesystem::path& file, double edge_m,
                                      const std::string& material) {
  if (!in_range(edge_m, 0.1, kMaxLengthM)) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("ground of {} m: must be in [0.1, 1e5]", edge_m));
  }
  constexpr std::uint32_t kCells = 32;
  const double h = 0.5 * edge_m;
  MeshBuilder ground("ground");
  ground.material(material);
  ground.grid_quad({-h, -h, 0.0}, {h, -h, 0.0}, {h, h, 0.0}, {-h, h, 0.0}, kCells, kCells);
  Scene scene;
  scene.place(scene.add_mesh(ground.take()), "ground");
  return write_glb(file, scene);
}

}  // namespace emit::scenegen
