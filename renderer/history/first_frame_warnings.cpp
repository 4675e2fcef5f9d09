// SPDX-License-Identifier: Apache-2.0
#include "history/first_frame_warnings.hpp"

#include <fmt/format.h>

namespace emit::renderer {
namespace {

/// Length of a short thermal history, ns. Shadows leave hardly any thermal trace on surfaces within
/// it.
constexpr std::int64_t kShortHistoryNs = 600'000'000'000;

double seconds(std::int64_t ns) noexcept {
  return static_cast<double>(ns) * 1e-9;
}

}  // namespace

std::vector<std::string> first_frame_warnings(const scene::ScenarioDesc& scenario,
                                              std::int64_t thermal_time_ns) {
  std::vector<std::string> out;
  const scene::ThermalOptions& thermal = scenario.thermal;
  const std::string file = scenario.file.empty() ? "scenario" : scenario.file.string();
  const double frame_s = seconds(thermal_time_ns);
  // A table of one row is constant weather, at all times.
  if (scenario.weather.size() > 1 && scenario.weather.back().sim_time_ns < thermal_time_ns) {
    // Rain of a row counts since the row before, so that nothing is known behind the last one.
    const bool rains = scenario.weather.back().rain_mm_h > 0.0;
    out.push_back(
        fmt::format("{}: the weather covers {} s to {} s, but the frame at {} s needs it from {} s "
                    "to {} s. The last row holds from {} s on{}",
                    file, seconds(scenario.weather.front().sim_time_ns),
                    seconds(scenario.weather.back().sim_time_ns), frame_s,
                    seconds(thermal.history_start_ns - thermal.spin_up_ns), frame_s,
                    seconds(scenario.weather.back().sim_time_ns),
                    rains ? ", but for its rain, which ends there" : ""));
  }
  if (thermal_time_ns - thermal.history_start_ns < kShortHistoryNs) {
    const bool spun_up = thermal.model == scene::ThermalModel::foster && thermal.spin_up_ns > 0;
    out.push_back(
        fmt::format("{}: the thermal history begins at {} s (thermal.history_start_s) and the "
                    "frame is at {} s, "
                    "so that {}. Let the history begin some hours before the frame",
                    file, seconds(thermal.history_start_ns), frame_s,
                    spun_up ? std::string("surfaces bear no marks of shadows")
                            : fmt::format("surfaces have thermal.initial_k, {} K, or little else",
                                          thermal.initial_k)));
  }
  return out;
}

}  // namespace emit::renderer
