// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_double3.hpp>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"

namespace emit::renderer {

/// Point of a surface at which a thermal sample of the method "cached" may lie.
struct SamplePlace {
  glm::dvec3 position_world_m{0.0};
  glm::dvec3 normal{0.0, 0.0, 1.0};  ///< unit length, out of the solid, world axes
  bool on_face = true;  ///< false: on an edge or corner, where `normal` belongs to no tangent plane
  glm::dvec3 to_sun{0.0, 0.0, 1.0};  ///< unit length, world axes
  /// Distance from the surface at which rays start, m, not negative. Rays start at 1e-6 of the
  /// point's distance from the middle of the scene where that is more, because float32 needs it.
  double offset_m = 5e-4;
};

/// Shares of sun and sky that a sample sees. A ray that leaves the scene counts as sky, below the
/// horizon too.
struct SampleSight {
  double sun_frac = 0.0;     ///< share of the sun's disc, which stands still; 0 off a face
  double cosine_frac = 0.0;  ///< cosine-weighted share of the hemisphere; 0 off a face
  double sphere_frac = 0.0;  ///< share of the full sphere of directions; 0.5 on open level ground
};

/// Traces the rays of a sample at one point of geometry in memory, with the classes that the
/// renderer uses (IntervalRays, ViewSampler, SphereSampler). `emit evaluate` checks them by it.
/// Thread: any. Real time: setup only. Errors: those of CasterRays.
/// @pre place.normal and place.to_sun are of unit length; place.offset_m >= 0.
[[nodiscard]] physics::Result<SampleSight> sight_of_sample(const scene::SceneGeometry& geometry,
                                                           const SamplePlace& place);

}  // namespace emit::renderer
