// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <functional>
#include <string>
#include <string_view>

#include "csv_table.hpp"
#include "emit/evaluate/evaluate.hpp"
#include "visibility_rows.hpp"

namespace emit::evaluate {

using MakeRow = std::function<physics::Result<VisibilityRow>(std::size_t)>;

/// Share of the sun's disc (column f) and sky factors (columns svf, f_uni) by the passes of the
/// frame on the geometry of each row. CSV text.
[[nodiscard]] physics::Result<std::string> gpu_sun_shares(const EvaluateRequest& request,
                                                          const CsvTable& table,
                                                          std::string_view outputs,
                                                          const MakeRow& make);
[[nodiscard]] physics::Result<std::string> gpu_sky_views(const EvaluateRequest& request,
                                                         const CsvTable& table,
                                                         std::string_view outputs,
                                                         const MakeRow& make);

}  // namespace emit::evaluate
