// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "emit/scene/scene_desc.hpp"

/// Rows and parameters that a weather table lacks for the thermal simulation, and their
/// replacement.
namespace emit::config {

/// Parameters of the clear-sky models that the user states. The others follow the table.
struct StatedClearSky {
  bool air_mean = false;
  bool air_amplitude = false;
  bool dew_point = false;
  bool wind = false;
  bool cloud = false;
};

/// Completes `scenario.weather`, a table of two rows or more, for a simulation that starts
/// thermal.spin_up_s before thermal.history_start_s:
/// - where the table begins later, the clear-sky models make the rows from that start on;
/// - where the table ends before that start, or begins more than 400 days behind it, the clear-sky
///   models replace it.
/// Parameters of the models that `stated` does not name are fitted to the table's nearest day and
/// written to scenario.clear_sky. Both cases, gaps between the rows, and rain of the first row,
/// which is left out because it has no begin, give one warning each in scenario.warnings, which
/// begins with `name`, the table's name for messages. Returns true when the clear-sky models are
/// used.
/// @pre scenario.weather is empty or ascending; place, epoch and thermal options are set.
bool complete_weather(std::string_view name, const StatedClearSky& stated,
                      scene::ScenarioDesc& scenario);

}  // namespace emit::config
