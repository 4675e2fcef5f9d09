// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <functional>
#include <string>
#include <string_view>

#include "emit/physics/csv.hpp"
#include "emit/verify/evaluate.hpp"
#include "visibility_rows.hpp"

/// Visibility by the real-time path on the geometry of each row: visible fraction of the sun's disc
/// (column f) and sky factors (columns svf, f_uni). Results are CSV text.
namespace emit::verify {

/// Function that builds the geometry of a row.
using MakeRow = std::function<physics::Result<VisibilityRow>(std::size_t)>;

/// Input of the functions below. All references must outlive it.
struct VisibilityQuery {
  const EvaluateRequest& request;
  const physics::CsvTable& table;
  std::string_view outputs;  ///< names of the output columns
  const MakeRow& make;
};

/// Runs the method that request.method names.
[[nodiscard]] physics::Result<std::string> gpu_sun_shares(const VisibilityQuery& query);
[[nodiscard]] physics::Result<std::string> gpu_sky_views(const VisibilityQuery& query);

/// Runs the passes of a frame: shadow map, soft shadow and volumetric obscurance.
[[nodiscard]] physics::Result<std::string> frame_sun_shares(const VisibilityQuery& query);
[[nodiscard]] physics::Result<std::string> frame_sky_views(const VisibilityQuery& query);

/// Runs the rays of the method `cached`.
[[nodiscard]] physics::Result<std::string> cached_sun_shares(const VisibilityQuery& query);
[[nodiscard]] physics::Result<std::string> cached_sky_views(const VisibilityQuery& query);

}  // namespace emit::verify
