// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "bench/accuracy/converged_model.hpp"
#include "bench/accuracy/pixel_surface.hpp"
#include "emit/reference/visibility.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

/// Views of sun and sky from surface points at each node of a history, by rays. Immutable: any
/// number of threads.
class ConvergedViews {
 public:
  struct Options {
    std::uint32_t steps = 1440;
    std::uint32_t sun_rays = 64;
    std::uint32_t sky_rays = 256;
    bool uniform_sky = false;  ///< share of the full sphere instead of the cosine-weighted one
  };

  /// Chooses the nodes from `start_ns` to `end_ns`; `extra_ns` become nodes as well. The caller
  /// keeps the scene alive.
  ConvergedViews(const reference::RayScene& scene, std::int64_t start_ns, std::int64_t end_ns,
                 std::span<const std::int64_t> extra_ns, const Options& options);

  [[nodiscard]] std::span<const std::int64_t> nodes_ns() const noexcept { return nodes_ns_; }

  /// Computes one entry per node. The point is given where it lies at the last node.
  /// @pre as many views as nodes; `model` has these nodes
  void see(const PixelSurface& point, const ConvergedModel& model, std::span<PointView> view) const;

 private:
  /// Position of a point at a node.
  struct Placed {
    reference::SurfacePoint point;
    bool absent = false;  ///< its entity was not in the scene
  };

  void choose_nodes(std::int64_t start_ns, std::int64_t end_ns,
                    std::span<const std::int64_t> extra_ns);
  [[nodiscard]] bool moves(std::int64_t from_ns, std::int64_t to_ns) const;
  [[nodiscard]] Placed placed(const PixelSurface& point, std::size_t node) const;
  [[nodiscard]] double sun_frac(const PixelSurface& point, const ConvergedModel& model,
                                std::size_t node) const;
  void fill_sun(const PixelSurface& point, const ConvergedModel& model, std::size_t first,
                std::size_t last, std::span<PointView> view) const;
  void fill_sky(const PixelSurface& point, std::span<PointView> view) const;
  [[nodiscard]] bool same_surroundings(const PixelSurface& point, const glm::dvec3& position_m,
                                       std::size_t a, std::size_t b) const;

  const reference::RayScene& scene_;
  Options options_;
  std::vector<std::int64_t> nodes_ns_;
  std::vector<reference::SceneInstant> instants_;  ///< per node
  std::vector<std::size_t> coarse_;                ///< nodes that are always looked at
};

}  // namespace emit::tool
