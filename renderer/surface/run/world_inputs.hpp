// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>

#include "history/band_lights.hpp"
#include "history/environment.hpp"
#include "history/part_history.hpp"
#include "history/pose_history.hpp"

namespace emit::renderer {

/// Sun, weather, poses of the entities, drives of their parts and light in band, which a surface
/// follows. All must outlive the call that gets them.
struct WorldInputs {
  const Environment& environment;
  std::span<const PoseHistory> entities;
  std::span<const PartHistory> parts{};  ///< ascending by entity
  /// Light in the bands of the picture. Null: samples send nothing to each other there.
  const BandLights* lights = nullptr;
};

}  // namespace emit::renderer
