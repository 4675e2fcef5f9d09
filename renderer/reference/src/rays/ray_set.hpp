// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "embree/embree_device.hpp"
#include "emit/physics/error.hpp"
#include "emit/reference/visibility.hpp"
#include "ray_cone_tree.hpp"
#include "ray_triangle.hpp"

namespace emit::reference {

/// Mesh and triangle of a scene that a triangle of a set comes from.
struct TriangleSource {
  std::uint32_t mesh = 0;
  std::uint32_t primitive = 0;
};

/// First hit of a ray on a set.
struct SetHit {
  TriangleHit triangle;
  std::uint32_t index = 0;  ///< index into the set's triangles
};

/// Triangles of one rigid frame in one hierarchy, relative to an origin in their middle.
class RaySet {
 public:
  struct Builder {
    std::vector<std::array<glm::dvec3, 3>> triangles;  ///< coordinates of the frame, m
    std::vector<TriangleSource> sources;
  };
  /// Builds the hierarchy. Errors: invalid_argument (too many triangles, wider than 1e15 m),
  /// internal (Embree).
  [[nodiscard]] static physics::Result<std::unique_ptr<RaySet>> create(RTCDeviceTy* device,
                                                                       Builder builder,
                                                                       RayArithmetic arithmetic);

  [[nodiscard]] bool empty() const noexcept { return triangles_.empty(); }
  [[nodiscard]] const glm::dvec3& origin_m() const noexcept { return origin_m_; }
  /// Returns the radius of a ball around the origin that contains every triangle.
  [[nodiscard]] double radius_m() const noexcept { return radius_m_; }
  [[nodiscard]] std::span<const std::array<glm::dvec3, 3>> triangles() const noexcept {
    return triangles_;  // relative to origin_m()
  }
  [[nodiscard]] TriangleSource source(std::uint32_t index) const { return sources_[index]; }

  /// Finds the nearest hit closer than `limit_m`; the first triangle wins a tie. The ray is
  /// relative to origin_m(). Returns false if there is none.
  [[nodiscard]] bool first_hit(const PreparedRay& ray, double limit_m, SetHit& hit) const;
  /// Returns true if anything stops the ray, which is relative to origin_m().
  [[nodiscard]] bool occluded(const PreparedRay& ray) const;
  /// Tests up to 16 rays of the same direction at once and sets their bits in `blocked`. It skips
  /// rays whose bit is set.
  /// @pre at most 16 rays.
  void occluded_16(std::span<const PreparedRay> rays, std::uint32_t& blocked) const;

  /// Appends the triangles that may lie within a cone, in ascending order.
  void in_cone(const glm::dvec3& apex_m, const glm::dvec3& axis, double semi_angle_rad,
               std::vector<std::uint32_t>& out) const;

 private:
  friend struct SetCallbacks;
  RaySet() = default;
  [[nodiscard]] bool enter(const PreparedRay& ray, glm::dvec3& start_m,
                           double& skipped_m) const noexcept;

  std::vector<std::array<glm::dvec3, 3>> triangles_;
  std::vector<TriangleSource> sources_;
  glm::dvec3 origin_m_{0.0};
  double radius_m_ = 0.0;
  double pad_m_ = 0.0;
  RayArithmetic arithmetic_ = RayArithmetic::exact;
  embree::Scene scene_;
  ConeTree cone_tree_;
};

}  // namespace emit::reference
