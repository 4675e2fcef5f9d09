// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "tool/logger/logger_file.hpp"
#include "tool/logger/measured_ground.hpp"

/// Signs in a record that dry layers do not describe its ground.
namespace emit::tool {

struct GroundSign {
  std::string kind;  ///< "evaporation", "vegetation", "snow", "sun", "fit" and others
  std::string text;
  bool breaks_model = true;  ///< false: dry layers still hold, with less certainty
};

/// Heat of the record's daylight, W/m2: means over the rows with 100 W/m2 of sun or more.
struct DayHeat {
  double hours = 0.0;
  double net_radiation_w_m2 = 0.0;
  double to_air_w_m2 = 0.0;     ///< through the film, at the measured surface
  double to_ground_w_m2 = 0.0;  ///< into dry layers whose face follows the measured surface
  /// Heat that neither air nor ground takes: evaporation, or an error of the rest.
  double missing_w_m2 = 0.0;
  double least_missing_w_m2 = 0.0;  ///< with a film 30 % and an inertia 40 % greater
};
/// Errors: those of reference::plate_history_k().
[[nodiscard]] physics::Result<DayHeat> day_heat(const LoggerRecord& record,
                                                const MeasuredGround& ground);

/// Returns what the record, its words and its material say against dry layers.
[[nodiscard]] std::vector<GroundSign> ground_signs(const LoggerRecord& record,
                                                   const MeasuredGround& ground,
                                                   const DayHeat& heat);

/// Returns what a fit says against its own numbers: one at the end of its range, far from what the
/// record measured, or known from too few independent rows.
[[nodiscard]] std::vector<GroundSign> fit_signs(const LoggerRecord& record,
                                                const MeasuredGround& ground,
                                                const reference::PlateFit& fit);

}  // namespace emit::tool
