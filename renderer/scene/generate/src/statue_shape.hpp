// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>

#include "polygonise.hpp"

namespace emit::scenegen {

/// Seated figure on a round pedestal. It faces south (-y), z is up, and it is about 2.65 m high at
/// scale 1. Its foot reaches 2 cm below the ground.
struct StatueShape {
  std::unique_ptr<SignedDistance> distance;
  glm::dvec3 min_m;
  glm::dvec3 max_m;
  double height_m;
};
/// Returns the figure.
[[nodiscard]] StatueShape statue_shape();

}  // namespace emit::scenegen
