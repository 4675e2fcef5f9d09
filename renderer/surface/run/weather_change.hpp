// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

#include "history/environment.hpp"
#include "surface/heat/surface_node.hpp"

namespace emit::renderer {

/// Returns true if the weather of `now_ns` differs from what a node was computed with by more than
/// the tolerance allows. `tolerance_k` is thermal.tolerance_k. Any thread; RT-safe.
[[nodiscard]] bool weather_matters(const SurfaceNode& node, std::int64_t now_ns,
                                   const Environment& environment, double tolerance_k) noexcept;

}  // namespace emit::renderer
