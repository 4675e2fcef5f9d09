// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/reference/surface_forcing.hpp"
#include "emit/reference/visibility.hpp"
#include "points/point_histories.hpp"

/// Views that points of the one-dimensional solution have of sun, sky and scene over their history.
namespace emit::reference {

/// Point that goes with its entity, if it has one.
class CarriedPoint {
 public:
  /// `now`: instant at which the point is where it says.
  CarriedPoint(const SolvePoint& point, const SceneInstant& now);
  /// Returns where the point is at an instant.
  [[nodiscard]] SurfacePoint at(const SceneInstant& instant) const;

 private:
  std::uint32_t entity_;
  glm::dvec3 position_m_;  ///< in the frame of the entity, or of the world
  glm::dvec3 normal_;      ///< likewise
};

/// Returns the instants at which every point is sampled, from the start of the climate's history to
/// `until_ns`. They are close together while anything moves, and far apart before `dense_from_ns`.
[[nodiscard]] std::vector<std::int64_t> view_nodes(const RayScene& scene,
                                                   const SurfaceClimate& climate,
                                                   std::int64_t dense_from_ns,
                                                   std::int64_t until_ns);

/// Scene at the nodes. The last one is the instant at which points are where they say.
struct SceneNodes {
  const RayScene& scene;
  std::span<const std::int64_t> times_ns;
  std::span<const SceneInstant> instants;
};

/// Returns the views of a point at the nodes, and between them where the sun's share changes.
/// `rays` count for the sky.
[[nodiscard]] std::vector<ViewSample> point_views(const SurfaceClimate& climate,
                                                  const SolvePoint& point, std::uint32_t rays,
                                                  const SceneNodes& nodes);

/// Stretch of the nodes over which no entity near a point moves by half a metre.
struct ViewEpoch {
  std::size_t first = 0;
  std::size_t last = 0;    ///< included
  bool brief = false;      ///< it is over within a minute
  bool own_moves = false;  ///< the point's own entity moves just before, in or after it
};
/// Cuts the history of a point into epochs.
[[nodiscard]] std::vector<ViewEpoch> view_epochs(const SolvePoint& point, const SceneNodes& nodes);

}  // namespace emit::reference
