// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "emit/physics/air_model.hpp"
#include "emit/scene/base.hpp"
#include "resolve.hpp"

namespace emit::config {

std::optional<physics::AirSpec> built_in_air(const AtmosphereDraft& draft,
                                             const scene::ScenarioDesc& scenario) {
  if (draft.model == "none") return std::nullopt;
  physics::AirSpec spec;
  spec.climate = draft.model == "auto"
                     ? physics::air_climate_of(scenario.place.lat_rad, scenario.epoch_utc_ns)
                     : physics::air_climate(draft.model).value_or(spec.climate);
  spec.visibility_km = draft.visibility_km;
  if (draft.water_ratio) {
    spec.water_ratio = *draft.water_ratio;
    return spec;
  }
  const auto column = physics::AirColumn::build({spec.climate, spec.visibility_km, 1.0});
  if (!column) return spec;
  // Weather tables have no humidity, so theirs is that of the climate at their temperature.
  const double vapour_ratio =
      scenario.weather.empty()
          ? physics::saturated_vapour_g_m3(scenario.clear_sky.dew_point_k) /
                column->ground_vapour_g_m3()
          : physics::saturated_vapour_g_m3(std::clamp(scene::mean_air_k(scenario), 200.0, 320.0)) /
                physics::saturated_vapour_g_m3(column->ground_k());
  spec.water_ratio = std::clamp(vapour_ratio, 0.0, 5.0);
  return spec;
}

}  // namespace emit::config
