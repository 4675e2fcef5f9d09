// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <functional>
#include <string>
#include <string_view>

#include "emit/physics/csv.hpp"
#include "emit/verify/evaluate.hpp"
#include "visibility_rows.hpp"

/// Share of the sun's disc (column f) and sky factors (columns svf, f_uni) as the real-time path
/// finds them on the geometry of each row. CSV text.
namespace emit::verify {

using MakeRow = std::function<physics::Result<VisibilityRow>(std::size_t)>;

/// What a query of the GPU path works on; all outlive it.
struct VisibilityQuery {
  const EvaluateRequest& request;
  const physics::CsvTable& table;
  std::string_view outputs;  ///< names of the columns
  const MakeRow& make;
};

/// By request.method.
[[nodiscard]] physics::Result<std::string> gpu_sun_shares(const VisibilityQuery& query);
[[nodiscard]] physics::Result<std::string> gpu_sky_views(const VisibilityQuery& query);

/// By the passes of a frame: shadow map, soft shadow and volumetric obscurance.
[[nodiscard]] physics::Result<std::string> frame_sun_shares(const VisibilityQuery& query);
[[nodiscard]] physics::Result<std::string> frame_sky_views(const VisibilityQuery& query);

/// By the rays of the method `cached`.
[[nodiscard]] physics::Result<std::string> cached_sun_shares(const VisibilityQuery& query);
[[nodiscard]] physics::Result<std::string> cached_sky_views(const VisibilityQuery& query);

}  // namespace emit::verify
