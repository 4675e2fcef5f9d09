// SPDX-License-Identifier: Apache-2.0
#include "surface/coarse_geometry.hpp"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "surface/caster_rays.hpp"
#include "surface/kept_facets.hpp"

namespace emit::renderer {
namespace {

constexpr std::uint32_t kMostDoublings = 3;

/// What sampling every instance at its vertices takes.
std::size_t sampled_vertices(const scene::SceneGeometry& geometry) {
  std::size_t count = 0;
  for (const scene::Instance& instance : geometry.instances) {
    count += geometry.meshes[instance.mesh].positions_m.size();
  }
  return count;
}

}  // namespace

physics::Result<CoarseGeometry> coarse_geometry(scene::SceneGeometry geometry,
                                                const scene::DetailView& view,
                                                std::span<const glm::vec3> to_suns,
                                                std::size_t max_samples) {
  std::vector<double> errors = scene::simplify_errors(geometry, view);
  CoarseGeometry out;
  if (std::ranges::none_of(errors, [](double error) { return error > 0.0; })) {
    out.geometry = std::move(geometry);
    return out;
  }
  scene::SceneGeometry full = std::move(geometry);
  auto rays = CasterRays::create(full);
  if (!rays) return tl::unexpected(std::move(rays.error()));
  out.geometry = scene::simplified(full, errors, kept_facets(full, errors, *rays, view, to_suns));
  for (std::uint32_t i = 0; i < kMostDoublings && sampled_vertices(out.geometry) > max_samples / 2;
       ++i) {
    out.visibly = true;
    for (double& error : errors) error *= 2.0;
    out.geometry = scene::simplified(full, errors);
  }
  if (out.geometry.triangles < full.triangles) {
    out.detail.emplace(std::move(full), std::move(*rays), out.geometry);
  }
  return out;
}

}  // namespace emit::renderer
