// SPDX-License-Identifier: Apache-2.0
#include "bench/stability/bench_stability_frame_tests.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "emit/physics/constants.hpp"

namespace emit::tool {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

Result<void> HostileFrames::low_sun() {
  for (const double elevation_deg : {1e-6, 1e-4, 0.01, 0.1, 0.499, 0.501, 2.0}) {
    World world = yard();
    world.parts.push_back(tilted_part("facing the sun", {-3.0, -3.0, 0.5}, {0.0, 0.0, 1.0}, 0.5));
    const auto rise =
        sun_rises_through_ns(world.scenario, 43'200 * kSecondNs, elevation_deg * physics::kDegree);
    if (!rise) return make_error(ErrorCode::internal, "the sun does not rise");
    world.time_ns = *rise;
    world.scenario.thermal.history_start_ns = *rise - 7200 * kSecondNs;
    const glm::dvec3 sun = direction_to_sun(world.scenario, *rise);
    world.parts.back() = tilted_part("facing the sun", glm::dvec3(-3.0, -3.0, 0.5), sun, 0.4);
    world.camera = looking_at(glm::dvec3(0.0, 0.0, 3.0) + 12.0 * sun, {-1.0, -1.0, 0.5});
    if (auto ok = judged_by_model(world, fmt::format("{} deg", elevation_deg)); !ok) return ok;
  }
  return {};
}

Result<void> HostileFrames::strong_low_sun() {
  for (const double elevation_deg : {1e-6, 0.1, 0.499, 0.501, 2.0}) {
    World world = yard();
    const auto rise =
        sun_rises_through_ns(world.scenario, 43'200 * kSecondNs, elevation_deg * physics::kDegree);
    if (!rise) return make_error(ErrorCode::internal, "the sun does not rise");
    world.time_ns = *rise;
    world.scenario.thermal.history_start_ns = *rise - 60 * kSecondNs;
    world.scenario.thermal.steps = 1;
    world.scenario.materials[0].modes = {{1e-3, 0.5}, {1e-3, 0.5}};
    scene::WeatherSample sample;
    sample.direct_normal_w_m2 = 800.0;
    sample.diffuse_horizontal_w_m2 = 50.0;
    sample.longwave_down_w_m2 = 330.0;
    sample.air_k = 290.0;
    world.scenario.weather = {sample};
    const glm::dvec3 sun = direction_to_sun(world.scenario, *rise);
    FlatPart face = tilted_part("facing the sun", {0.0, 0.0, 5.0}, sun, 3.0);
    face.open = true;
    world.parts.push_back(face);
    world.camera = looking_at(glm::dvec3(0.0, 0.0, 6.0) + 12.0 * sun, {0.0, 0.0, 4.0});
    if (auto ok = judged_by_model(world, fmt::format("{} deg", elevation_deg)); !ok) return ok;
  }
  return {};
}

Result<void> HostileFrames::grazing_sun() {
  World world = yard();
  world.parts.clear();
  const glm::dvec3 sun = direction_to_sun(world.scenario, world.time_ns);
  const glm::dvec3 across = glm::normalize(glm::cross(sun, glm::dvec3(0.0, 0.0, 1.0)));
  const glm::dvec3 upright = glm::cross(across, sun);  // edge-on to the sun, facing up
  int i = 0;
  for (const double angle_rad : {-0.1, -1e-3, -1e-6, 1e-6, 1e-4, 1e-3, 1e-2, 0.1}) {
    const glm::dvec3 normal = std::cos(angle_rad) * upright + std::sin(angle_rad) * sun;
    world.parts.push_back(
        tilted_part(fmt::format("{:g} rad", angle_rad), across * (3.0 * (i++ - 3.5)), normal, 1.2));
    // The sun moves: a face that is edge-on now was lit before. Nothing stands between the faces
    // and the sun.
    world.parts.back().open = true;
  }
  world.camera = looking_at(upright * 30.0, glm::dvec3(0.0));
  return judged_by_model(world, "tiles");
}

Result<void> HostileFrames::grazing_view() {
  for (const double height_m : {1e-4, 1e-3, 1e-2}) {
    World world = yard();
    world.scenario.sensor.near_m = 1e-5;
    world.camera = looking_at({-8.0, -10.0, height_m}, {0.0, 0.0, height_m});
    if (auto ok = judged_by_model(world, fmt::format("{} m", height_m)); !ok) return ok;
  }
  return {};
}

Result<void> HostileFrames::coincident_faces() {
  World world = yard();
  world.scenario.thermal.obscurance_radius_m = 0.5;
  const auto harmless = frame(world, "once");
  if (!harmless) return tl::unexpected(harmless.error());
  for (FlatPart& part : world.parts) {
    const std::vector<FlatFace> once = part.faces;
    part.faces.insert(part.faces.end(), once.begin(), once.end());
    for (const FlatFace& face : once) {
      part.faces.push_back({{face.corners[3], face.corners[2], face.corners[1], face.corners[0]}});
    }
  }
  return judged_by(world, "three times", *harmless);
}

Result<void> HostileFrames::degenerate_triangles() {
  World world = yard();
  world.scenario.thermal.obscurance_radius_m = 0.5;
  const auto harmless = frame(world, "without");
  if (!harmless) return tl::unexpected(harmless.error());
  for (std::size_t i = 0; i < world.parts.size(); ++i) {
    FlatPart& part = world.parts[i];
    const glm::dvec3 a = part.faces[0].corners[0];
    const glm::dvec3 b = part.faces[0].corners[1];
    const glm::dvec3 c = part.faces[0].corners[2];
    part.faces.push_back({{a, a, a, a}});                                    // a point
    part.faces.push_back({{a, b, 0.5 * (a + b), 0.25 * a + 0.75 * b}});      // a line
    part.faces.push_back({{a, b, b + 1e-9 * (c - b), a + 1e-9 * (c - b)}});  // a sliver
    part.faces.push_back({{a, a, c, c}});  // a line there and back
  }
  return judged_by(world, "with", *harmless);
}

Result<void> HostileFrames::far_from_origin() {
  World world = yard();
  world.scenario.thermal.obscurance_radius_m = 0.5;
  const auto harmless = frame(world, "origin");
  if (!harmless) return tl::unexpected(harmless.error());
  for (const double distance_m : {1e5, 1e6}) {
    World moved = world;
    const glm::dvec3 by_m(distance_m, -distance_m, 0.0);
    for (FlatPart& part : moved.parts) {
      part.placed_at_m = by_m;
      for (FlatFace& face : part.faces) {
        for (glm::dvec3& corner : face.corners) corner += by_m;
      }
    }
    moved.camera.position_world_m += by_m;
    if (auto ok = judged_by(moved, fmt::format("{:g} m", distance_m), *harmless); !ok) return ok;
  }
  return {};
}

Result<void> HostileFrames::far_vertices() {
  World world = yard();
  world.scenario.thermal.obscurance_radius_m = 0.5;
  const auto harmless = frame(world, "origin");
  if (!harmless) return tl::unexpected(harmless.error());
  const glm::dvec3 by_m(1e5, -1e5, 0.0);
  for (FlatPart& part : world.parts) {
    for (FlatFace& face : part.faces) {
      for (glm::dvec3& corner : face.corners) corner += by_m;
    }
  }
  world.camera.position_world_m += by_m;
  return judged_by(world, "100 km", *harmless);
}

/// Adds a wall 100 km behind the yard that faces the camera.
static void add_far_wall(World& world) {
  world.parts.push_back(tilted_part("wall at 100 km", {0.0, 1e5, 2e4}, {0.0, -1.0, 0.0}, 2e4));
  world.parts.back().open = true;
}

Result<void> HostileFrames::depth_range() {
  World world = yard();
  world.scenario.thermal.max_cascades = 4;
  add_far_wall(world);
  world.camera = looking_at({0.0, -12.0, 1.5}, {0.0, 0.0, 2.0});
  return judged_by_model(world, "0.1 m to 100 km");
}

Result<void> HostileFrames::depth_range_near_part() {
  World world = yard();
  world.scenario.thermal.max_cascades = 4;
  world.camera = looking_at({0.0, -12.0, 1.5}, {0.0, 0.0, 2.0});
  const auto harmless = frame(world, "without");
  if (!harmless) return tl::unexpected(harmless.error());
  add_far_wall(world);
  return judged_by(world, "with", *harmless);
}

Result<void> HostileFrames::object_scale() {
  World world = yard();
  world.scenario.thermal.obscurance_radius_m = 0.5;
  const auto harmless = frame(world, "1");
  if (!harmless) return tl::unexpected(harmless.error());
  for (const double scale : {1e-3, 1e3}) {
    for (FlatPart& part : world.parts) part.scale = scale;
    if (auto ok = judged_by(world, fmt::format("{:g}", scale), *harmless); !ok) return ok;
  }
  return {};
}

Result<void> HostileFrames::world_scale() {
  World world = yard();
  world.scenario.thermal.obscurance_radius_m = 0.5;
  const auto harmless = frame(world, "1");
  if (!harmless) return tl::unexpected(harmless.error());
  for (const double scale : {1e-2, 1e3}) {
    World scaled = world;
    for (FlatPart& part : scaled.parts) {
      for (FlatFace& face : part.faces) {
        for (glm::dvec3& corner : face.corners) corner *= scale;
      }
    }
    scaled.camera.position_world_m *= scale;
    scaled.scenario.sensor.near_m *= scale;
    scaled.scenario.thermal.obscurance_radius_m *= scale;
    if (auto ok = judged_by(scaled, fmt::format("{:g}", scale), *harmless); !ok) return ok;
  }
  return {};
}

Result<void> HostileFrames::long_history() {
  for (const std::uint32_t steps : {1U, 27U, 365U}) {
    World world = yard();
    world.scenario.thermal.history_start_ns = world.time_ns - kYearNs;
    world.scenario.thermal.steps = steps;
    world.scenario.thermal.shadow_map_px = 128;
    if (auto ok = judged_by_model(world, fmt::format("{} steps", steps)); !ok) return ok;
  }
  return {};
}

Result<void> HostileFrames::short_history() {
  for (const std::int64_t history_ns : {std::int64_t{0}, std::int64_t{1}, kSecondNs / 1000}) {
    World world = yard();
    world.scenario.thermal.history_start_ns = world.time_ns - history_ns;
    if (auto ok = judged_by_model(world, fmt::format("{} ns", history_ns)); !ok) return ok;
  }
  return {};
}

Result<void> HostileFrames::many_steps() {
  World world = yard();
  // The maps have few pixels, because thousands of them are drawn for this one frame.
  world.scenario.thermal.shadow_map_px = 64;
  world.scenario.thermal.blocker_taps = 1;
  world.scenario.thermal.filter_taps = 1;
  world.scenario.thermal.max_cascades = 1;
  world.scenario.thermal.steps = 100'000;
  const TemporaryFolder folder;
  if (auto ok = place_parts(world.parts, folder.path(), world.scenario); !ok) return ok;
  const auto refused = open_renderer(world.scenario, options_.gpu_index);
  if (refused) {
    extra_note_ = "100000 steps are accepted";
  } else {
    extra_note_ = fmt::format("100000 steps are refused: '{}'", refused.error().text);
    world.scenario.thermal.steps = 4096;
  }
  return judged_by_model(world, fmt::format("{} steps", world.scenario.thermal.steps));
}

Result<void> HostileFrames::extreme_materials() {
  World world = yard();
  const scene::Material plain = world.scenario.materials[0];
  world.parts.clear();
  world.scenario.materials.clear();
  const auto add = [&](const char* name, const auto& change) {
    scene::Material material = plain;
    material.name = name;
    change(material);
    world.scenario.materials.push_back(std::move(material));
  };
  using M = scene::Material;
  add("surface", [](M&) {});
  add("insulation", [](M& m) { m.layers = {{1.0, 0.02, 30.0, 900.0}}; });
  add("foil", [](M& m) { m.layers = {{1e-4, 400.0, 8900.0, 385.0}}; });
  add("mirror", [](M& m) {
    m.emissivity_frac = 0.02;
    m.layers = {{1.0, 0.02, 30.0, 900.0}};
  });
  add("black", [](M& m) {
    m.emissivity_frac = 1.0;
    m.solar_absorptance_frac = 1.0;
  });
  add("cold core", [](M& m) {
    m.base_k = 0.0;
    m.initial_k = 0.0;
  });
  add("hot core", [](M& m) {
    m.base_k = 6000.0;
    m.initial_k = 6000.0;
    m.layers = {{1e-4, 400.0, 8900.0, 385.0}};
  });
  add("fast", [](M& m) { m.modes = {{5.0, 0.9}, {5.0, 0.1}}; });
  add("slow", [](M& m) {
    m.modes = {{3e6, 0.5}, {3e6, 0.5}};
    m.initial_k = 6000.0;
  });
  add("0 K", [](M& m) { m.prescribed_k = 0.0; });
  add("6000 K", [](M& m) { m.prescribed_k = 6000.0; });
  add("no layer", [](M& m) { m.layers.clear(); });
  for (std::size_t i = 0; i < world.scenario.materials.size(); ++i) {
    FlatPart tile = level_part(
        world.scenario.materials[i].name,
        {2.0 * static_cast<double>(i % 4) - 3.0, 2.0 * static_cast<double>(i / 4) - 2.0, 0.0}, 0.9,
        0.9);
    tile.material = world.scenario.materials[i].name;
    tile.open = true;
    world.parts.push_back(std::move(tile));
  }
  world.camera = looking_at({0.0, -3.0, 9.0}, {0.0, 0.0, 0.0});
  return judged_by_model(world, "tiles");
}

Result<void> HostileFrames::obscurance_radius() {
  for (const double radius_m : {1e-6, 1e-3, 0.5, 10.0, 1e3, 1e6}) {
    World world = yard();
    world.parts = {level_part("ground", {0.0, 0.0, 0.0}, 3e4, 3e4)};
    world.parts[0].open = true;
    world.scenario.thermal.obscurance_radius_m = radius_m;
    world.camera = looking_at({0.0, -12.0, 1.5}, {0.0, 0.0, 0.2});
    if (auto ok = judged_by_model(world, fmt::format("{:g} m", radius_m)); !ok) return ok;
  }
  return {};
}

Result<void> HostileFrames::taps_and_maps() {
  struct Setting {
    std::uint32_t blocker;
    std::uint32_t filter;
    std::uint32_t map_px;
  };
  for (const Setting& s : {Setting{1, 1, 16}, Setting{256, 256, 64}, Setting{8, 32, 4096}}) {
    World world = yard();
    world.scenario.thermal.steps = 3;
    world.scenario.thermal.blocker_taps = s.blocker;
    world.scenario.thermal.filter_taps = s.filter;
    world.scenario.thermal.shadow_map_px = s.map_px;
    if (auto ok =
            judged_by_model(world, fmt::format("{}+{} taps {} px", s.blocker, s.filter, s.map_px));
        !ok) {
      return ok;
    }
  }
  return {};
}

Result<void> HostileFrames::hostile_weather() {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  std::string silent;
  static constexpr std::array<const char*, 5> kNames{"direct", "diffuse", "longwave", "air",
                                                     "environment"};
  for (const double value : {kNan, kInf, -kInf, -1e4, 1e30}) {
    for (int field = 0; field < 5; ++field) {
      World world = yard();
      world.scenario.thermal.steps = 2;
      scene::WeatherSample sample;
      sample.direct_normal_w_m2 = 700.0;
      sample.diffuse_horizontal_w_m2 = 80.0;
      sample.longwave_down_w_m2 = 330.0;
      sample.air_k = 290.0;
      sample.environment_k = 290.0;
      const std::array<double*, 5> fields{
          &sample.direct_normal_w_m2, &sample.diffuse_horizontal_w_m2, &sample.longwave_down_w_m2,
          &sample.air_k, &*sample.environment_k};
      *fields[static_cast<std::size_t>(field)] = value;
      const auto stored = frame(world, fmt::format("field {} = {}", field, value),
                                [&](renderer::Renderer& r) { r.apply_weather(sample); });
      if (!stored) return tl::unexpected(stored.error());
      if (stored->stats.clamped_px > 0 || stored->stats.nonfinite_px > 0) continue;
      silent += fmt::format("{}{} = {:g}", silent.empty() ? "" : ", ",
                            kNames[static_cast<std::size_t>(field)], value);
    }
  }
  extra_note_ = "no flag for: " + (silent.empty() ? std::string("none") : silent);
  return {};
}

Result<void> HostileFrames::hostile_camera() {
  const auto shot = [&](const char* name, double fov_deg, double near_m,
                        const physics::Pose& pose) {
    World world = yard();
    world.scenario.sensor.fov_h_rad = fov_deg * physics::kDegree;
    world.scenario.sensor.near_m = near_m;
    world.camera = pose;
    return judged_by_model(world, name);
  };
  const physics::Pose plain = yard().camera;
  if (auto ok = shot("narrow", 1e-3, 0.1, plain); !ok) return ok;
  if (auto ok = shot("wide", 170.0, 0.1, plain); !ok) return ok;
  if (auto ok = shot("inside", 40.0, 0.1, looking_at({0, 0, 1}, {1, 0.2, 1})); !ok) return ok;
  if (auto ok = shot("under", 40.0, 0.1, looking_at({3, 3, -1}, {3, 3.5, 0})); !ok) return ok;
  if (auto ok = shot("down", 40.0, 0.1, looking_at({0, 0, 9}, {0, 0, 0})); !ok) return ok;
  if (auto ok = shot("into the sky", 40.0, 0.1, looking_at({0, 0, 9}, {0, 1, 20})); !ok) return ok;
  if (auto ok = shot("near plane behind all", 40.0, 1e4, plain); !ok) return ok;
  return shot("near plane 1e-7 m", 40.0, 1e-7, plain);
}

}  // namespace emit::tool
