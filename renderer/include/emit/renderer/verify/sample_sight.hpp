// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_double3.hpp>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"

namespace emit::renderer {

/// A point from which a thermal sample of the method `cached` looks.
struct SamplePlace {
  glm::dvec3 position_world_m{0.0};
  glm::dvec3 normal{0.0, 0.0, 1.0};  ///< unit length, out of the solid
  bool on_face = true;  ///< false: on an edge or a corner, where `normal` is no tangent plane's
  glm::dvec3 to_sun{0.0, 0.0, 1.0};  ///< unit length
  /// Rays start this far off the surface, or 1e-6 of the point's distance from the middle of the
  /// scene where float32 needs more.
  double offset_m = 5e-4;
};

/// What it sees. Whatever leaves the scene counts as sky, below the horizon too.
struct SampleSight {
  double sun_frac = 0.0;     ///< of the sun's disc, which stands still; 0 off a face
  double cosine_frac = 0.0;  ///< cosine-weighted share of the hemisphere; 0 off a face
  double sphere_frac = 0.0;  ///< of the full sphere of directions: 0.5 on open level ground
};

/// Asks the very rays of a sample (IntervalRays, ViewSampler, SphereSampler) about one point of
/// geometry in memory, for checking them by themselves (`emit evaluate`). Setup class; any thread.
/// Errors: those of CasterRays.
[[nodiscard]] physics::Result<SampleSight> sight_of_sample(const scene::SceneGeometry& geometry,
                                                           const SamplePlace& place);

}  // namespace emit::renderer
