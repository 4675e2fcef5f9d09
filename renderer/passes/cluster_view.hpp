// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/vector_float3.hpp>

#include "emit/scene/clusters.hpp"
#include "passes/light_fit.hpp"

namespace emit::renderer {

/// Inward normals of the planes that bound the view pyramid, through the camera; relworld axes, not
/// of unit length.
[[nodiscard]] std::array<glm::dvec3, 5> view_planes(const ViewVolume& view) noexcept;

/// The camera's view in the coordinates of one mesh: which of its clusters are worth drawing.
/// Never wrong about a cluster that shows: bounds are widened by what float32 rounds.
class ClusterView {
 public:
  ClusterView(const ViewVolume& view, const glm::dmat4& relworld_from_mesh) noexcept;

  /// False: outside the pyramid or, unless `double_sided`, all of it turned away.
  [[nodiscard]] bool shows(const scene::Cluster& cluster, bool double_sided) const noexcept;

 private:
  struct Plane {
    glm::vec3 normal{0.0F};  ///< unit length
    float offset_m = 0.0F;
  };
  std::array<Plane, 5> planes_;
  glm::vec3 eye_m_{0.0F};
  float margin_m_ = 0.0F;
  bool mirrored_ = false;
};

}  // namespace emit::renderer
