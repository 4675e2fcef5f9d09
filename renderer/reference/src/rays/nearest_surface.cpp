// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/nearest_surface.hpp"

#include <glm/geometric.hpp>
#include <vector>

namespace emit::reference {

std::optional<RayHit> nearest_surface(const SceneInstant& instant, const glm::dvec3& position_m,
                                      const std::optional<glm::dvec3>& normal,
                                      const std::function<bool(const RayHit&)>& accept) {
  std::vector<glm::dvec3> from;
  if (normal) {
    from.push_back(glm::normalize(*normal));
  } else {
    for (const double x : {0.0, -1.0, 1.0}) {
      for (const double y : {0.0, -1.0, 1.0}) {
        for (const double z : {1.0, -1.0, 0.0}) {
          if (x != 0.0 || y != 0.0 || z != 0.0) from.push_back(glm::normalize(glm::dvec3(x, y, z)));
        }
      }
    }
  }
  std::optional<RayHit> best;
  double nearest_m = kProbeReachM;
  for (const glm::dvec3& outwards : from) {
    const auto hit = instant.first_hit({position_m + kProbeReachM * outwards, -outwards, 0.0});
    if (!hit || !accept(*hit)) continue;
    const double away_m = glm::distance(hit->position_world_m, position_m);
    if (away_m >= nearest_m) continue;
    nearest_m = away_m;
    best = *hit;
  }
  return best;
}

}  // namespace emit::reference
