// SPDX-License-Identifier: Apache-2.0
#include "draw/cluster_view.hpp"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "emit/physics/check.hpp"

namespace emit::renderer {
namespace {

/// Relative rounding error of float32 after several operations.
constexpr float kRounding = 4e-6F;

}  // namespace

std::array<glm::dvec3, 5> view_planes(const ViewVolume& view) noexcept {
  const glm::dmat3& m = view.relworld_from_sensor;
  const glm::dvec4 tan = view.drawn_tan.value_or(
      glm::dvec4(-view.tan_half_h, -view.tan_half_v, view.tan_half_h, view.tan_half_v));
  return {m * glm::dvec3(1.0, 0.0, -tan.x), m * glm::dvec3(-1.0, 0.0, tan.z),
          m * glm::dvec3(0.0, 1.0, -tan.y), m * glm::dvec3(0.0, -1.0, tan.w),
          m * glm::dvec3(0.0, 0.0, 1.0)};
}

ClusterView::ClusterView(const ViewVolume& view, const glm::dmat4& relworld_from_mesh,
                         const LevelLimits& limits) noexcept {
  // Transform the planes of the view into the coordinates of the mesh.
  const glm::dmat3 linear(relworld_from_mesh);
  const glm::dvec3 origin_m(relworld_from_mesh[3]);
  const std::array<glm::dvec3, 5> normals = view_planes(view);
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const glm::dvec3 in_mesh = glm::transpose(linear) * normals[i];
    const double length = glm::length(in_mesh);
    planes_[i] = {glm::vec3(in_mesh / length),
                  static_cast<float>(glm::dot(normals[i], origin_m) / length)};
  }
  const glm::dvec3 eye_m = -(glm::inverse(linear) * origin_m);
  eye_m_ = glm::vec3(eye_m);
  margin_m_ = kRounding * static_cast<float>(glm::length(eye_m));
  mirrored_ = glm::determinant(linear) < 0.0;
  // Compare lengths of the mesh with distances in its own axes. Where the mesh is stretched
  // unequally, an error may lie along the axis that is stretched most and the distance along the
  // other one.
  const std::array<double, 3> scale = {glm::length(linear[0]), glm::length(linear[1]),
                                       glm::length(linear[2])};
  const auto [least, greatest] = std::ranges::minmax(scale);
  evenness_ = least / greatest;
  set_limits(limits);
}

void ClusterView::set_limits(const LevelLimits& limits) noexcept {
  EMIT_CHECK_OP(limits.difference, <, kLevelDifferencesK.size());
  const double pixel = limits.pixel_rad * evenness_;
  deviation_ = static_cast<float>(limits.deviation_px * pixel);
  size_ = static_cast<float>(limits.size_px * pixel);
  edge_ = static_cast<float>(limits.edge_px * pixel);
  difference_ = limits.difference;
}

bool ClusterView::fine(const LevelError& error) const noexcept {
  const float distance_m = std::max(0.0F, glm::distance(error.centre_m, eye_m_) - error.radius_m);
  return error.deviation_m <= deviation_ * distance_m && error.size_m <= size_ * distance_m &&
         error.edge_m[difference_] <= edge_ * distance_m;
}

bool ClusterView::shows(const scene::Cluster& cluster, bool double_sided) const noexcept {
  // Compare the bounding sphere with the planes.
  const float reach_m =
      (1.0F + kRounding) * cluster.radius_m + margin_m_ + kRounding * glm::length(cluster.centre_m);
  for (const Plane& plane : planes_) {
    if (glm::dot(plane.normal, cluster.centre_m) + plane.offset_m < -reach_m) return false;
  }
  // Compare the bounding box with the planes.
  const float box_margin_m = margin_m_ + kRounding * glm::length(cluster.box_centre_m);
  for (const Plane& plane : planes_) {
    // An infinite box gives NaN here, which makes the cluster visible.
    const float box_reach_m =
        (1.0F + kRounding) * glm::dot(glm::abs(plane.normal), cluster.box_half_m) + box_margin_m;
    if (glm::dot(plane.normal, cluster.box_centre_m) + plane.offset_m < -box_reach_m) return false;
  }
  // Compare the cone of normals with the direction to the camera.
  if (double_sided || mirrored_ || cluster.cone_cutoff >= 1.0F) return true;
  const glm::vec3 way = cluster.cone_apex_m - eye_m_;
  return glm::dot(way, cluster.cone_axis) <
         cluster.cone_cutoff * glm::length(way) + 1e-3F * reach_m + kRounding * glm::length(way);
}

}  // namespace emit::renderer
