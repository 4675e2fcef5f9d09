// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "emit/physics/constants.hpp"
#include "emit/physics/weather.hpp"
#include "resolve.hpp"

namespace emit::config {
namespace {

/// Height at which weather states its wind, and exponent of the law that leads up from there.
constexpr double kWindHeightM = 10.0;
constexpr double kWindExponent = 1.0 / 7.0;

/// Sets the drift: as stated, or by the wind of the weather.
void set_drift(const Node& node, const CloudsDraft& draft, const scene::ScenarioDesc& scenario,
               physics::Clouds& clouds, Diagnostics& diagnostics) {
  double wind_m_s = scenario.clear_sky.wind_m_s;
  bool known = scenario.clear_sky.wind_from_rad.has_value();
  double from_rad = scenario.clear_sky.wind_from_rad.value_or(0.0);
  if (!scenario.weather.empty()) {
    const physics::Forcing wind = physics::forcing_from_rows(scenario.weather, 0);
    wind_m_s = wind.wind_m_s;
    known = std::hypot(wind.wind_to_east, wind.wind_to_north) > 0.0;
    from_rad = known ? std::atan2(-wind.wind_to_east, -wind.wind_to_north) : 0.0;
  }
  clouds.drift_m_s =
      draft.drift_m_s.value_or(wind_m_s * std::pow(clouds.base_m / kWindHeightM, kWindExponent));
  clouds.drift_from_rad = draft.drift_from_rad.value_or(from_rad);
  if (clouds.drift_from_rad < 0.0) clouds.drift_from_rad += 2.0 * physics::kPi;
  if (!known && !draft.drift_from_rad && clouds.drift_m_s > 0.0) {
    diagnostics.add(node.at,
                    "'drift_from_deg' is missing, and the weather states no direction of the wind "
                    "at simulation time 0");
  }
}

}  // namespace

void resolve_clouds(const Node& root, scene::ScenarioDesc& scenario, Diagnostics& diagnostics) {
  if (!root.has("clouds")) return;
  const Node& node = section(root, "clouds", diagnostics);
  CloudsDraft draft;
  const std::size_t faults = diagnostics.size();
  read_table(node, clouds_keys(), draft, diagnostics);
  if (diagnostics.size() != faults) return;
  physics::Clouds& clouds = draft.clouds;
  if (scenario.thermal.method != scene::ThermalMethod::cached ||
      scenario.thermal.model != scene::ThermalModel::foster) {
    diagnostics.add(node.at,
                    "[clouds] needs thermal.method = \"cached\" and thermal.model = \"foster\"");
  }
  if (!(clouds.longest_m > clouds.shortest_m) ||
      clouds.longest_m > physics::Clouds::kMostRatio * clouds.shortest_m) {
    diagnostics.add(
        key_location(node, node.has("longest_m") ? "longest_m" : "shortest_m"),
        fmt::format("'longest_m' ({}) must be above 'shortest_m' ({}), and at most {} times it",
                    toml_number(clouds.longest_m), toml_number(clouds.shortest_m),
                    toml_number(physics::Clouds::kMostRatio)));
  }
  const Node& weather = section(root, "weather", diagnostics);
  for (const auto& [of_weather, here] :
       {std::pair("cloud_frac", "cover_frac"), std::pair("cloud_base_m", "base_m")}) {
    if (!weather.has(of_weather)) continue;
    diagnostics.add(
        key_location(weather, of_weather),
        fmt::format("'{}' has no place beside [clouds], whose '{}' says it", of_weather, here));
  }
  set_drift(node, draft, scenario, clouds, diagnostics);
  // The models of the clear sky have the same clouds; a table has the sun that was measured.
  if (scenario.weather.empty()) {
    scenario.clear_sky.cloud_frac = clouds.cover_frac;
    scenario.clear_sky.cloud_transmission_frac = clouds.transmission_frac;
  }
  scenario.clear_sky.cloud_base.height_m = clouds.base_m;
  scenario.clouds = clouds;
}

}  // namespace emit::config
