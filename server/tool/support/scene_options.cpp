// SPDX-License-Identifier: Apache-2.0
#include "tool/support/scene_options.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>
#include <functional>
#include <map>

#include "emit/physics/nearest_name.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using scenegen::SceneKind;
using Setter = std::function<bool(std::string_view)>;

template <class Number>
Setter number(Number& target) {
  return [&target](std::string_view text) {
    Number value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size()) return false;
    target = value;
    return true;
  };
}

std::map<std::string, Setter, std::less<>> setters(scenegen::GenerateOptions& options) {
  switch (options.kind) {
    case SceneKind::box:
      return {{"size_m", number(options.box.size_m)}, {"plane_m", number(options.box.plane_m)}};
    case SceneKind::statue:
      return {{"min_triangles", number(options.statue.min_triangles)},
              {"height_m", number(options.statue.height_m)},
              {"plane_m", number(options.statue.plane_m)}};
    case SceneKind::block_on_road:
      return {{"block_size_m",
               [&block = options.block_on_road](std::string_view text) {
                 if (!number(block.block_east_m)(text)) return false;
                 block.block_north_m = block.block_up_m = block.block_east_m;
                 return true;
               }},
              {"block_east_m", number(options.block_on_road.block_east_m)},
              {"block_north_m", number(options.block_on_road.block_north_m)},
              {"block_up_m", number(options.block_on_road.block_up_m)},
              {"wall_thickness_m", number(options.block_on_road.wall_thickness_m)},
              {"road_east_m", number(options.block_on_road.road_east_m)},
              {"road_north_m", number(options.block_on_road.road_north_m)}};
    case SceneKind::ribbed:
      return {{"ribs", number(options.ribbed.ribs)},
              {"pitch_m", number(options.ribbed.pitch_m)},
              {"rib_width_m", number(options.ribbed.rib_width_m)},
              {"rib_height_m", number(options.ribbed.rib_height_m)},
              {"length_m", number(options.ribbed.length_m)}};
    case SceneKind::airfield:
      return {{"seed", number(options.airfield.seed)}};
    case SceneKind::sea:
      break;
  }
  return {};
}

std::vector<std::string> keys_of(const std::map<std::string, Setter, std::less<>>& table) {
  std::vector<std::string> keys;
  for (const auto& [key, setter] : table) keys.push_back(key);
  return keys;
}

}  // namespace

std::vector<SceneKind> all_scene_kinds() {
  return {SceneKind::box,    SceneKind::statue,   SceneKind::block_on_road,
          SceneKind::ribbed, SceneKind::airfield, SceneKind::sea};
}

std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  for (const SceneKind kind : all_scene_kinds()) names.emplace_back(scenegen::to_string(kind));
  names.emplace_back("all");
  return names;
}

physics::Result<void> apply_scene_options(scenegen::GenerateOptions& options,
                                          std::span<const std::string> set) {
  const auto table = setters(options);
  for (const std::string& entry : set) {
    const std::size_t equals = entry.find('=');
    const std::string key = entry.substr(0, equals);
    const auto found = table.find(key);
    if (equals == std::string::npos) {
      return make_error(
          ErrorCode::invalid_argument,
          fmt::format("--set {}: the value is missing: --set {}=VALUE", entry, entry));
    }
    if (found == table.end()) {
      const std::vector<std::string> known = keys_of(table);
      return make_error(
          ErrorCode::invalid_argument,
          fmt::format("--set {}: unknown option '{}'{}; scene '{}' has {}", entry, key,
                      physics::did_you_mean(key, known), scenegen::to_string(options.kind),
                      known.empty() ? std::string("no options")
                                    : fmt::format("the options {}", fmt::join(known, ", "))));
    }
    if (!found->second(std::string_view(entry).substr(equals + 1))) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("--set {}: the value is not a number of that kind", entry));
    }
  }
  return {};
}

physics::Result<void> generate_scenes(const std::string& scene,
                                      const std::filesystem::path& directory,
                                      std::span<const std::string> set) {
  std::vector<SceneKind> kinds;
  if (scene == "all") {
    kinds = all_scene_kinds();
    if (!set.empty()) {
      return make_error(ErrorCode::invalid_argument, "--set goes with one scene, not with 'all'");
    }
  } else if (const auto kind = scenegen::scene_kind_from(scene)) {
    kinds.push_back(*kind);
  } else {
    const std::vector<std::string> known = scene_names();
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("unknown scene '{}'{}; there are {}", scene,
                                  physics::did_you_mean(scene, known), fmt::join(known, ", ")));
  }
  for (const SceneKind kind : kinds) {
    scenegen::GenerateOptions options;
    options.kind = kind;
    options.directory = directory;
    if (auto applied = apply_scene_options(options, set); !applied) {
      return tl::unexpected(applied.error());
    }
    const auto generated = scenegen::generate(options);
    if (!generated) return tl::unexpected(generated.error());
    for (const auto& file : generated->files) {
      fmt::print("{}  {} triangles  {} vertices  {} bytes\n", file.path.string(), file.triangles,
                 file.vertices, file.bytes);
    }
  }
  return {};
}

}  // namespace emit::tool
