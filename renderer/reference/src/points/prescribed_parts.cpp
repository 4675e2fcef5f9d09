// SPDX-License-Identifier: Apache-2.0
#include "points/prescribed_parts.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <map>

#include "emit/physics/constants.hpp"

namespace emit::reference {
namespace {

/// A piece is cut into four while its longest side is above this part of its distance.
constexpr double kSidePerDistance = 0.25;
constexpr int kMostCuts = 5;
/// Irradiance below which a triangle does not count, W/m2.
constexpr double kLeastW_m2 = 1e-3;
/// Part of the distance by which a ray may end before the piece that it goes to.
constexpr double kSamePlaceFrac = 1e-6;

using Corners = std::array<glm::dvec3, 3>;

double longest_side_m(const Corners& c) {
  return std::max(
      {glm::distance(c[0], c[1]), glm::distance(c[1], c[2]), glm::distance(c[2], c[0])});
}

/// Returns the share of a point's hemisphere that the visible pieces of a triangle cover.
double visible_share(const SurfacePoint& point, const Corners& c, int cuts,
                     const SceneInstant& instant) {
  const glm::dvec3 middle_m = (c[0] + c[1] + c[2]) / 3.0;
  const double distance_m = glm::distance(middle_m, point.position_world_m);
  if (cuts > 0 && longest_side_m(c) > kSidePerDistance * distance_m) {
    const glm::dvec3 ab = 0.5 * (c[0] + c[1]);
    const glm::dvec3 bc = 0.5 * (c[1] + c[2]);
    const glm::dvec3 ca = 0.5 * (c[2] + c[0]);
    return visible_share(point, {c[0], ab, ca}, cuts - 1, instant) +
           visible_share(point, {ab, c[1], bc}, cuts - 1, instant) +
           visible_share(point, {ca, bc, c[2]}, cuts - 1, instant) +
           visible_share(point, {ab, bc, ca}, cuts - 1, instant);
  }
  const double share = triangle_share(point.position_world_m, point.normal, c);
  if (!(share > 0.0) || !(distance_m > 0.0)) return 0.0;
  const Ray ray{point.position_world_m, (middle_m - point.position_world_m) / distance_m,
                point.tolerance_m};
  const auto hit = instant.first_hit(ray);
  return hit && hit->distance_m < (1.0 - kSamePlaceFrac) * distance_m ? 0.0 : share;
}

}  // namespace

double triangle_share(const glm::dvec3& point_m, const glm::dvec3& normal,
                      const std::array<glm::dvec3, 3>& corners_m) {
  // Keep what lies above the tangent plane: at most four corners.
  std::array<glm::dvec3, 4> above{};
  std::size_t count = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const glm::dvec3 a = corners_m[i] - point_m;
    const glm::dvec3 b = corners_m[(i + 1) % 3] - point_m;
    const double a_up = glm::dot(a, normal);
    const double b_up = glm::dot(b, normal);
    if (a_up > 0.0) above[count++] = a;
    if ((a_up > 0.0) != (b_up > 0.0)) above[count++] = a + (b - a) * (a_up / (a_up - b_up));
  }
  // Sum the angles between the corners, each times the cosine of its plane to the tangent plane.
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const glm::dvec3& a = above[i];
    const glm::dvec3& b = above[(i + 1) % count];
    const glm::dvec3 across = glm::cross(a, b);
    const double size = glm::length(across);
    if (size > 0.0) sum += std::atan2(size, glm::dot(a, b)) * glm::dot(across, normal) / size;
  }
  return std::abs(sum) / (2.0 * physics::kPi);
}

PrescribedParts::PrescribedParts(const scene::SceneGeometry& geometry, const RayScene& scene)
    : geometry_(geometry) {
  for (const RayMesh& mesh : scene.desc().meshes) {
    if (mesh.entity == kNoEntity) continue;
    for (std::size_t t = 0; 3 * t + 2 < mesh.indices.size(); ++t) {
      const std::uint32_t material =
          mesh.materials.empty() ? 0 : mesh.materials[mesh.materials.size() == 1 ? 0 : t];
      if (!geometry.materials[material].prescribed_k) continue;
      Triangle out{
          {mesh.positions_m[mesh.indices[3 * t]], mesh.positions_m[mesh.indices[3 * t + 1]],
           mesh.positions_m[mesh.indices[3 * t + 2]]},
          mesh.entity,
          material};
      const auto& [a, b, c] = out.corners_m;
      out.area_m2 = 0.5 * glm::length(glm::cross(b - a, c - a));
      if (out.area_m2 > 0.0) triangles_.push_back(out);
    }
  }
}

std::vector<PartLink> PrescribedParts::seen_from(const SurfacePoint& point, std::uint32_t own,
                                                 bool others, const SceneInstant& instant) const {
  std::map<std::uint32_t, double> shares;
  for (const Triangle& part : triangles_) {
    if (part.entity != own && (!others || !instant.entity_on(part.entity))) continue;
    const scene::Material& material = geometry_.materials[part.material];
    const physics::Pose& pose = instant.entity_pose(part.entity);
    Corners world{};
    for (std::size_t i = 0; i < 3; ++i) {
      world[i] = pose.position_world_m + pose.world_from_body * part.corners_m[i];
    }
    // Leave out what shows its back, and what is too far off to count.
    const glm::dvec3 to_point_m = point.position_world_m - world[0];
    const glm::dvec3 outward = glm::cross(world[1] - world[0], world[2] - world[0]);
    if (!material.sheet && !(glm::dot(outward, to_point_m) > 0.0)) continue;
    const double away_m = glm::length(to_point_m) - longest_side_m(world);
    const double kelvin2 = *material.prescribed_k * *material.prescribed_k;
    const double black_w_m2 = physics::kStefanBoltzmannWPerM2K4 * kelvin2 * kelvin2;
    if (away_m > 0.0 && black_w_m2 * part.area_m2 < kLeastW_m2 * physics::kPi * away_m * away_m) {
      continue;
    }
    const double share = visible_share(point, world, kMostCuts, instant);
    if (share > 0.0) shares[part.material] += share;
  }
  std::vector<PartLink> out;
  for (const auto& [index, share] : shares) {
    const scene::Material& material = geometry_.materials[index];
    const double kelvin2 = *material.prescribed_k * *material.prescribed_k;
    out.push_back(
        {index, share,
         material.emissivity_frac * physics::kStefanBoltzmannWPerM2K4 * kelvin2 * kelvin2});
  }
  return out;
}

}  // namespace emit::reference
