// SPDX-License-Identifier: Apache-2.0
#include "emit/renderer/verify/sample_sight.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>
#include <vector>

#include "emit/physics/check.hpp"
#include "surface/rays/caster_rays.hpp"
#include "surface/rays/interval_rays.hpp"
#include "surface/rays/sphere_view.hpp"
#include "surface/rays/surface_view.hpp"

namespace emit::renderer {
namespace {

/// Smallest offset of a ray from the surface, as a share of the point's distance from the origin of
/// the rays.
constexpr float kOffsetFrac = 1e-6F;

}  // namespace

physics::Result<SampleSight> sight_of_sample(const scene::SceneGeometry& geometry,
                                             const SamplePlace& place) {
  EMIT_CHECK_OP(std::abs(glm::dot(place.normal, place.normal) - 1.0), <, 1e-6);
  EMIT_CHECK_OP(std::abs(glm::dot(place.to_sun, place.to_sun) - 1.0), <, 1e-6);
  EMIT_CHECK_OP(place.offset_m, >=, 0.0);
  // Set up the rays and the point in their coordinates.
  const auto casters = CasterRays::create(geometry);
  if (!casters) return tl::unexpected(casters.error());
  ViewPoint point;
  point.position_m = glm::vec3(place.position_world_m - casters->origin_world_m());
  point.normal = glm::vec3(place.normal);
  point.offset_m =
      std::max(static_cast<float>(place.offset_m), kOffsetFrac * glm::length(point.position_m));
  const CasterSelection everything;
  // Take the share of the full sphere.
  const SphereSampler sphere(kSampleViewRays);
  SampleSight sight;
  if (!place.on_face) {
    const SphereShares shares = sphere.all_around(*casters, point, everything);
    sight.sphere_frac = static_cast<double>(shares.sky_frac) + shares.far_frac;
    return sight;
  }
  const SphereShares shares = sphere.of_face(*casters, point, everything);
  sight.sphere_frac = static_cast<double>(shares.sky_frac) + shares.far_frac;
  // Take the cosine-weighted share of the hemisphere.
  const ViewShares open = ViewSampler(kSampleSkyRays).shares(*casters, point, everything);
  sight.cosine_frac = static_cast<double>(open.sky_frac) + open.far_frac;
  // Take the share of the sun's disc.
  SurfaceSample sample;
  sample.position_m = point.position_m;
  sample.normal = point.normal;
  IntervalRays sun{std::vector<float>{}};
  sun.hold(place.to_sun);
  sight.sun_frac = sun.sun_frac(*casters, sample, point.offset_m, 0.0F);
  return sight;
}

}  // namespace emit::renderer
