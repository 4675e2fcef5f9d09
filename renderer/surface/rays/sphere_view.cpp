// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/sphere_view.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>

#include "emit/physics/constants.hpp"
#include "surface/mesh/tangents.hpp"

namespace emit::renderer {
namespace {

constexpr std::size_t kPacket = CasterRays::kMaxRays;

}  // namespace

SphereSampler::SphereSampler(std::uint32_t rays) {
  rays = std::max(rays + 15U, 16U) / 16U * 16U;
  // Turn by the golden angle from ray to ray: no two directions then lie close together (Vogel
  // 1979).
  const double turn_rad = physics::kPi * (3.0 - std::sqrt(5.0));
  for (std::uint32_t i = 0; i < rays; ++i) {
    const double height = (i + 0.5) / rays;
    const double radius = std::sqrt(1.0 - height * height);
    directions_.emplace_back(radius * std::cos(i * turn_rad), radius * std::sin(i * turn_rad),
                             height);
  }
}

void SphereSampler::add_hemisphere(const CasterRays& casters, const ViewPoint& point, float side,
                                   const CasterSelection& selection,
                                   SphereShares& shares) const noexcept {
  // Start off the surface and off the edge, so that no ray hits its own face.
  const Tangents tangents = tangents_of(point.normal);
  const glm::vec3 start_m = point.position_m + point.offset_m * (point.normal + point.inward);
  const float weight_frac = 0.5F / static_cast<float>(directions_.size());
  for (std::size_t begin = 0; begin < directions_.size(); begin += kPacket) {
    // Turn a packet of directions into the axes of the point.
    std::array<CasterRay, kPacket> rays;
    for (std::size_t i = 0; i < kPacket; ++i) {
      const glm::vec3& local = directions_[begin + i];
      rays[i] = {start_m, glm::normalize(local.x * tangents.u + local.y * tangents.v +
                                         side * local.z * point.normal)};
    }
    // Count the rays that leave the scene; both hemispheres together weigh 1.
    const std::uint32_t blocked = casters.blocked(rays, selection);
    for (std::size_t i = 0; i < kPacket; ++i) {
      if (((blocked >> i) & 1U) != 0U) continue;
      (rays[i].direction.z >= 0.0F ? shares.sky_frac : shares.far_frac) += weight_frac;
    }
  }
}

SphereShares SphereSampler::of_face(const CasterRays& casters, const ViewPoint& point,
                                    const CasterSelection& selection) const noexcept {
  SphereShares shares;
  add_hemisphere(casters, point, 1.0F, selection, shares);
  return shares;
}

SphereShares SphereSampler::all_around(const CasterRays& casters, const ViewPoint& point,
                                       const CasterSelection& selection) const noexcept {
  SphereShares shares;
  add_hemisphere(casters, point, 1.0F, selection, shares);
  add_hemisphere(casters, point, -1.0F, selection, shares);
  return shares;
}

}  // namespace emit::renderer
