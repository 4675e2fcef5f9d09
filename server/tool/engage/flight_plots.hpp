// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <vector>

#include "tool/engage/engage_report.hpp"
#include "tool/support/svg_plot.hpp"

namespace emit::tool {

/// Range below which angles say little: the target fills the image, and a metre is a large angle.
inline constexpr double kFarM = 200.0;

/// Returns the error of the measured direction as a distance in the image plane; NaN where nothing
/// was measured.
[[nodiscard]] double measured_error_px(const LoopFrame& frame, double focal_px);

/// Returns the diagrams of a flight.
/// @pre there was a flight
[[nodiscard]] std::vector<Plot> flight_plots(const EngageResults& results);

}  // namespace emit::tool
