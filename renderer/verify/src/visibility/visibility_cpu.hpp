// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>

#include "emit/physics/csv.hpp"
#include "emit/reference/visibility.hpp"
#include "emit/verify/evaluate.hpp"
#include "visibility_rows.hpp"

namespace emit::verify {

/// Default number of rays per row and measure. The error is below 2e-3 for every kind of geometry.
inline constexpr std::uint32_t kSunRays = 16384;
inline constexpr std::uint32_t kSkyRays = 16384;

/// Builds the geometry of each row by `make` and measures it by `ask`. Rows are distributed over
/// the cores, so both functions run on several threads at once. Errors name file and line of the
/// first bad row.
[[nodiscard]] physics::Result<void> for_each_row(
    const physics::CsvTable& table,
    const std::function<physics::Result<VisibilityRow>(std::size_t)>& make,
    const std::function<void(std::size_t, const VisibilityRow&, const reference::SceneInstant&)>&
        ask);

/// Returns the point of a row for the ray tracer.
[[nodiscard]] inline reference::SurfacePoint surface_point(const VisibilityRow& row) {
  return {.position_world_m = row.point_m, .normal = row.normal};
}

/// Checks the options of a visibility model. Errors (invalid_argument): --precision float32 or
/// --method on the CPU, or --rays on the GPU.
[[nodiscard]] physics::Result<void> check_visibility_options(const EvaluateRequest& request);

}  // namespace emit::verify
