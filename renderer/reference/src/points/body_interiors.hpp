// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "emit/reference/surface_forcing.hpp"
#include "emit/reference/visibility.hpp"
#include "points/point_histories.hpp"

namespace emit::reference {

/// Temperatures of the interiors of bodies, for faces whose material rests on one. An interior is
/// one well-mixed mass: the heat that leaves its faces through their bases warms it, and it
/// exchanges air with the outside,
///
///   C dT/dt = sum A q_base + G (T_air - T)
///
/// with the C and G of scene::BodyInterior times the area of these faces. A number of points,
/// spread evenly over the faces, stands for all of them. Rounds over the whole history alternate
/// between the points, whose bases follow the interior, and the interior, which follows their heat.
/// Owner: the caller, one thread. The arguments of the constructor must outlive it.
class BodyInteriors {
 public:
  /// `nodes_ns`: instants between which interiors are linear. `now`: the scene at the last of them.
  BodyInteriors(const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry,
                const RayScene& scene, const SurfaceClimate& climate,
                std::span<const std::int64_t> nodes_ns, const SceneInstant& now);

  /// Adds the bodies on whose interiors these points rest, each with a number of points that stand
  /// for its faces. Setup: it allocates.
  void add(std::span<const SolvePoint> points, std::size_t points_per_body);
  [[nodiscard]] std::size_t size() const noexcept { return bodies_.size(); }
  /// Returns the points that stand for the faces, in the order in which their bodies were added.
  [[nodiscard]] std::span<const SolvePoint> points() const noexcept { return points_; }
  /// Returns the temperature of the interior on which a point rests; empty if it rests on none.
  /// @pre add() has seen a point of that body
  [[nodiscard]] std::span<const BaseSample> course(const SolvePoint& point) const;

  /// Computes the heat that has left a point through its base by every node, J/m2, under a course
  /// of the interior. It is called from several threads.
  using Carry = std::function<void(std::size_t point, std::span<const BaseSample> base,
                                   std::span<double> out_base_j_m2)>;
  /// Brings the first `bodies` bodies into balance with their points. Calls `done` after each round
  /// with the share done; a return of false stops the work. Returns false then.
  [[nodiscard]] bool balance(std::size_t bodies, const Carry& carry,
                             const std::function<bool(double)>& done);
  /// Returns the largest change of an interior in the last round of any balance, K.
  [[nodiscard]] double left_k() const noexcept { return left_k_; }

 private:
  struct Body {
    std::size_t first = 0;  ///< of its points
    std::size_t count = 0;
    double heat_j_m2_k = 0.0;  ///< by area of the faces, like all that follow
    double ventilation_w_m2_k = 0.0;
    double answer_w_m2_k = 0.0;  ///< estimate of what the faces take from a warmer interior
    std::vector<BaseSample> course;
  };
  using Key = std::pair<std::uint32_t, std::uint32_t>;  ///< object and placement

  [[nodiscard]] Key key_of(const SolvePoint& point) const;
  void spread_points(const Key& key, std::size_t count, Body& body);
  [[nodiscard]] double follow(Body& body, std::span<const double> heat_j_m2) const;

  const scene::ScenarioDesc& scenario_;
  const scene::SceneGeometry& geometry_;
  const RayScene& scene_;
  std::span<const std::int64_t> nodes_ns_;
  const SceneInstant& now_;
  std::vector<double> air_k_;  ///< at the nodes
  std::map<Key, std::size_t> index_;
  std::vector<Body> bodies_;
  std::vector<SolvePoint> points_;
  double left_k_ = 0.0;
};

}  // namespace emit::reference
