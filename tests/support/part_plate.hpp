// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cmath>
#include <utility>
#include <vector>

#include "support/cached_session.hpp"

/// A plate that heats itself, in air that alone cools it.
namespace emit::test {

using PartKind = scene::PartCommand::Kind;

inline constexpr double kFilmW_m2K = 15.0;
inline constexpr double kAirK = 290.0;
/// 2 mm of aluminium.
inline constexpr double kSkinJ_m2K = 0.002 * 2700.0 * 900.0;
inline constexpr double kPartFromS = 7200.0;

/// Scenario of a plate, entity 7, that faces up at a height, in a steady wind without sun. Its skin
/// on foam neither absorbs nor emits to speak of, so that the film alone cools it.
inline scene::ScenarioDesc plate_world(std::vector<scene::TimedPartCommand> commands,
                                       scene::PartCurve curve = {}) {
  scene::ScenarioDesc s = cached_scenario(write_quads("ground", {ground(3.0, 3.0)}));
  scene::WeatherSample air = weather(0.0, 0.0, 400.0, kAirK);
  air.film_w_m2_k = kFilmW_m2K;
  s.weather = {air};
  scene::Material& ground_material = s.materials[0];
  ground_material.base_k = kAirK;
  scene::Material skin = ground_material;
  skin.name = "skin";
  skin.layers = {{0.002, 200.0, 2700, 900}, {0.5, 0.02, 20, 1000}};
  skin.emissivity_frac = 1e-3;
  skin.solar_absorptance_frac = 0.0;
  skin.modes.clear();
  s.materials.push_back(skin);
  scene::ObjectDesc plate = s.objects.front();
  plate.name = "plate";
  plate.gltf = write_quads("plate", {ground(2.0, 2.0)});
  plate.material = "skin";
  plate.entity_id = 7;
  plate.instances.front().position_world_m = {0.0, 0.0, 20.0};
  plate.parts = {{1, "skin", "skin", curve, std::move(commands)}};
  s.objects.push_back(plate);
  return s;
}

inline std::int64_t at_ns(double after_s) {
  return std::llround((kPartFromS + after_s) * 1e9);
}

/// Temperature in the middle of the image.
inline double middle_k(Session& session, double after_s) {
  const physics::Pose eye = looking({0.0, -0.001, 22.0}, {0.0, 0.0, 20.0});
  const auto frame = session.frame_k(at_ns(after_s), eye);
  return static_cast<double>(frame[kHeight / 2 * kWidth + kWidth / 2]);
}

}  // namespace emit::test
