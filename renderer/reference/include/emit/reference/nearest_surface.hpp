// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <functional>
#include <glm/ext/vector_double3.hpp>
#include <optional>

#include "emit/reference/visibility.hpp"

namespace emit::reference {

/// Largest distance of a probe from the surface that it stands for.
inline constexpr double kProbeReachM = 0.02;

/// Finds the surface nearest to a point, closer than kProbeReachM, by rays that come in from around
/// it, or along `normal` (out of the body, not zero) where that is given. `accept` chooses among
/// hits. Thread: any. Real time: setup only.
[[nodiscard]] std::optional<RayHit> nearest_surface(
    const SceneInstant& instant, const glm::dvec3& position_m,
    const std::optional<glm::dvec3>& normal, const std::function<bool(const RayHit&)>& accept);

}  // namespace emit::reference
