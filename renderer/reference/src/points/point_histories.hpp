// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/reference/surface_forcing.hpp"
#include "emit/reference/visibility.hpp"

namespace emit::reference {

/// Point of a surface at the instant of the image.
struct SolvePoint {
  glm::dvec3 position_world_m{0.0};
  glm::dvec3 normal{0.0};  ///< unit normal towards the visible side
  std::uint32_t material = 0;
  std::uint32_t entity = kNoEntity;
  std::uint32_t instance = 0;  ///< index into SceneGeometry::instances
};

/// Share of a point's hemisphere that shows a patch of the scenery.
struct SightLink {
  std::uint32_t patch = 0;
  double share_frac = 0.0;
};
/// Share of a point's hemisphere that shows parts of entities with a prescribed temperature.
struct PartLink {
  std::uint32_t material = 0;
  double share_frac = 0.0;
  double emitted_w_m2 = 0.0;  ///< by the parts, per area of their own
};
/// Patches and parts in the view of a point from an instant on.
struct SightEpoch {
  std::int64_t from_ns = 0;
  std::vector<SightLink> links;
  std::vector<PartLink> parts;
};
/// Patches and parts in the view of a point over its history. An epoch lasts until the next one
/// begins.
struct PointSight {
  std::vector<SightEpoch> epochs;  ///< ascending; empty: no patches

  /// Returns the links of the last epoch, in which the picture lies.
  [[nodiscard]] std::span<const SightLink> now() const noexcept {
    return epochs.empty() ? std::span<const SightLink>() : epochs.back().links;
  }
  /// Returns the parts of the last epoch.
  [[nodiscard]] std::span<const PartLink> parts_now() const noexcept {
    return epochs.empty() ? std::span<const PartLink>() : epochs.back().parts;
  }
};

/// State of a patch at an instant.
struct PatchState {
  double temperature_k = 0.0;
  double sky_frac = 0.0;  ///< of the patch's own hemisphere
};

class SightBuilder;

/// Temperatures of points, and what they see at that instant.
struct PointSolution {
  std::vector<double> kelvin;
  std::vector<PointSight> sights;  ///< one per point; without links if there is no exchange
  std::vector<std::uint32_t> patch_material;
  std::vector<PatchState> patches;
  double interior_left_k = 0.0;  ///< largest change of an interior in the last round
};

/// One-dimensional histories of points, with the visibility of sun and sky at the places where the
/// points were in the past, and with the radiation of what they see: with thermal.exchange, rays
/// end on patches with histories of their own, and theirs on further patches, which take all that
/// they see for surroundings of the environment's temperature. While an object moves, what it sees
/// and what it sends to others count as surroundings. Parts of objects with a prescribed
/// temperature are summed over their area (PrescribedParts); they emit, and reflect nothing. Faces
/// that rest on the interior of their body follow its temperature (BodyInteriors), which patches
/// take from faces without exchange. Owner: the caller.
class PointHistories {
 public:
  /// Prepares histories from the start of the climate's history. Visibility is sampled densely from
  /// `dense_from_ns` on. The arguments must outlive the object.
  PointHistories(const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry,
                 const RayScene& scene, const SurfaceClimate& climate, std::uint32_t rays,
                 std::int64_t dense_from_ns);

  /// Returns the temperature of every point at `sim_time_ns`. The work is spread over the cores.
  /// The calling thread calls `done` between portions with the share done; a return of false stops
  /// the run, and the other points are NaN.
  /// Errors: those of material_mesh().
  [[nodiscard]] physics::Result<PointSolution> temperatures(
      std::span<const SolvePoint> points, std::int64_t sim_time_ns,
      const std::function<bool(double)>& done) const;

 private:
  class Run;
  void trace_sights(const Run& run, std::span<const SolvePoint> points, double patch_factor,
                    SightBuilder& sight, std::span<PointSight> front,
                    std::span<PointSight> back) const;

  const scene::ScenarioDesc& scenario_;
  const scene::SceneGeometry& geometry_;
  const RayScene& scene_;
  const SurfaceClimate& climate_;
  std::uint32_t rays_;
  std::int64_t dense_from_ns_;
};

}  // namespace emit::reference
