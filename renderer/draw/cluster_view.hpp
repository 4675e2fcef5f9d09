// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/vector_float3.hpp>

#include "draw/light_fit.hpp"
#include "emit/scene/clusters.hpp"
#include "surface/mesh/cluster_levels.hpp"

namespace emit::renderer {

/// Inward normals of the planes that bound the drawn part of the view pyramid, in relworld axes.
/// The planes run through the camera. The normals are not of unit length. RT-safe.
[[nodiscard]] std::array<glm::dvec3, 5> view_planes(const ViewVolume& view) noexcept;

/// View of the camera in the coordinates of one mesh. It decides which clusters of the mesh are
/// drawn. It never leaves out a visible cluster, because bounds are widened by the rounding of
/// float32. Real time: all functions are RT-safe.
class ClusterView {
 public:
  /// View of the mesh that `relworld_from_mesh` places, with the error limits `limits`.
  ClusterView(const ViewVolume& view, const glm::dmat4& relworld_from_mesh,
              const LevelLimits& limits) noexcept;
  /// Replaces the error limits that fits() applies.
  /// @pre limits.difference < kLevelDifferencesK.size()
  void set_limits(const LevelLimits& limits) noexcept;

  /// False when the cluster lies outside the pyramid or, unless it is `double_sided`, when all of
  /// its triangles face away from the camera.
  [[nodiscard]] bool shows(const scene::Cluster& cluster, bool double_sided) const noexcept;
  /// True for the coarsest clusters that keep to the limits. Exactly one level of each part of the
  /// surface fits.
  [[nodiscard]] bool fits(const ClusterLevel& level) const noexcept {
    return fine(level.own) && !(level.has_coarser && fine(level.coarser));
  }

 private:
  /// Plane in the coordinates of the mesh.
  struct Plane {
    glm::vec3 normal{0.0F};  ///< unit length, inward
    float offset_m = 0.0F;
  };
  /// True when the error keeps to the limits at its distance.
  [[nodiscard]] bool fine(const LevelError& error) const noexcept;

  std::array<Plane, 5> planes_;
  glm::vec3 eye_m_{0.0F};  ///< position of the camera in the mesh
  float margin_m_ = 0.0F;  ///< rounding error of distances to the planes
  bool mirrored_ = false;
  double evenness_ = 1.0;  ///< smallest scale of the mesh's axes divided by the largest
  // Limits of each error, as a length per metre of distance.
  float deviation_ = 0.0F;
  float size_ = 0.0F;
  float edge_ = 0.0F;
  std::size_t difference_ = 0;  ///< entry of kLevelDifferencesK whose edges are limited
};

}  // namespace emit::renderer
