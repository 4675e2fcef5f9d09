// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/vector_float3.hpp>

#include "emit/scene/clusters.hpp"
#include "draw/light_fit.hpp"
#include "surface/mesh/cluster_levels.hpp"

namespace emit::renderer {

/// Inward normals of the planes that bound what is drawn of the view pyramid, through the camera;
/// relworld axes, not of unit length.
[[nodiscard]] std::array<glm::dvec3, 5> view_planes(const ViewVolume& view) noexcept;

/// The camera's view in the coordinates of one mesh: which of its clusters are worth drawing.
/// Never wrong about a cluster that shows: bounds are widened by what float32 rounds.
class ClusterView {
 public:
  ClusterView(const ViewVolume& view, const glm::dmat4& relworld_from_mesh,
              const LevelLimits& limits) noexcept;
  /// Other limits for fits().
  void set_limits(const LevelLimits& limits) noexcept;

  /// False: outside the pyramid or, unless `double_sided`, all of it turned away.
  [[nodiscard]] bool shows(const scene::Cluster& cluster, bool double_sided) const noexcept;
  /// True for the coarsest clusters that are good enough: of all levels each place has one.
  [[nodiscard]] bool fits(const ClusterLevel& level) const noexcept {
    return fine(level.own) && !(level.has_coarser && fine(level.coarser));
  }

 private:
  struct Plane {
    glm::vec3 normal{0.0F};  ///< unit length
    float offset_m = 0.0F;
  };
  [[nodiscard]] bool fine(const LevelError& error) const noexcept;

  std::array<Plane, 5> planes_;
  glm::vec3 eye_m_{0.0F};
  float margin_m_ = 0.0F;
  bool mirrored_ = false;
  double evenness_ = 1.0;  ///< least stretch of the mesh's axes against the greatest
  /// Lengths that may be wrong, per length of distance.
  float deviation_ = 0.0F;
  float size_ = 0.0F;
  float edge_ = 0.0F;
  std::size_t difference_ = 0;
};

}  // namespace emit::renderer
