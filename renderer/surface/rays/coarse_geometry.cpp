// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/coarse_geometry.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "surface/rays/caster_rays.hpp"
#include "surface/rays/kept_facets.hpp"

namespace emit::renderer {
namespace {

/// Largest number of times that the errors double: from a quarter of a pixel to two.
constexpr std::uint32_t kMaxDoublings = 3;
/// Smallest share of its vertices that a scene must lose to make visible errors acceptable.
constexpr double kMinGainFrac = 0.1;

/// Returns the number of samples that all instances of meshes that may change take, with one at
/// every vertex.
std::size_t sampled_vertices(const scene::SceneGeometry& geometry, std::span<const double> errors) {
  std::size_t count = 0;
  for (const scene::Instance& instance : geometry.instances) {
    if (errors[instance.mesh] > 0.0) count += geometry.meshes[instance.mesh].positions_m.size();
  }
  return count;
}

/// Simplifies with doubled errors until at most `most` vertices are left. Returns nothing if that
/// removes too little. `unseen` is the number of vertices without visible errors.
std::optional<scene::SceneGeometry> visibly_simplified(const scene::SceneGeometry& full,
                                                       std::vector<double> errors,
                                                       std::size_t unseen, std::size_t most) {
  std::optional<scene::SceneGeometry> out;
  std::size_t left = unseen;
  for (std::uint32_t i = 0; i < kMaxDoublings && left > most; ++i) {
    for (double& error : errors) error *= 2.0;
    out = scene::simplified(full, errors);
    left = sampled_vertices(*out, errors);
  }
  const bool pays = static_cast<double>(left) <= (1.0 - kMinGainFrac) * static_cast<double>(unseen);
  return pays ? std::move(out) : std::nullopt;
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
  // Remove what no pixel shows. The full scene stays for rays.
  scene::SceneGeometry full = std::move(geometry);
  auto rays = CasterRays::create(full);
  if (!rays) return tl::unexpected(std::move(rays.error()));
  const std::size_t most = max_samples / 2;
  out.geometry = scene::simplified(full, errors);
  std::size_t unseen = sampled_vertices(out.geometry, errors);
  if (unseen > most) {
    // Let the outlines of small bodies become coarser first.
    auto by_pixels = scene::simplify_errors(full, view, std::numeric_limits<double>::infinity());
    if (by_pixels != errors) {
      errors = std::move(by_pixels);
      out.geometry = scene::simplified(full, errors);
      unseen = sampled_vertices(out.geometry, errors);
    }
    // Allow visible errors if there are still too many vertices.
    if (auto less = visibly_simplified(full, errors, unseen, most)) {
      out.geometry = std::move(*less);
      out.visibly = true;
    }
  } else {
    // Keep facets that would have to be halved again, if that leaves enough samples.
    auto kept = scene::simplified(full, errors, kept_facets(full, errors, *rays, view, to_suns));
    if (sampled_vertices(kept, errors) <= most) out.geometry = std::move(kept);
  }
  if (out.geometry.triangles < full.triangles) {
    out.detail.emplace(std::move(full), std::move(*rays), out.geometry);
  }
  return out;
}

}  // namespace emit::renderer
