// SPDX-License-Identifier: Apache-2.0
#include "history/environment.hpp"

#include <algorithm>

namespace emit::renderer {
namespace {

physics::WeatherRow row_from(const scene::WeatherSample& sample) noexcept {
  return {.time_ns = sample.sim_time_ns,
          .direct_normal_w_m2 = sample.direct_normal_w_m2,
          .diffuse_horizontal_w_m2 = sample.diffuse_horizontal_w_m2,
          .longwave_down_w_m2 = sample.longwave_down_w_m2,
          .air_k = sample.air_k,
          .wind_m_s = sample.wind_m_s,
          .cloud_frac = sample.cloud_frac,
          .environment_k = sample.environment_k,
          .film_w_m2_k = sample.film_w_m2_k};
}

}  // namespace

Environment::Environment(const scene::ScenarioDesc& scenario)
    : place_{physics::Radians(scenario.place.lat_rad), physics::Radians(scenario.place.lon_rad),
             physics::Metres(scenario.place.height_m)},
      epoch_utc_ns_(scenario.epoch_utc_ns),
      clear_sky_{.linke_turbidity = scenario.clear_sky.linke_turbidity,
                 .air_mean_k = scenario.clear_sky.air_mean_k,
                 .air_amplitude_k = scenario.clear_sky.air_amplitude_k,
                 .dew_point_k = scenario.clear_sky.dew_point_k,
                 .wind_m_s = scenario.clear_sky.wind_m_s,
                 .cloud_frac = scenario.clear_sky.cloud_frac} {
  for (const scene::WeatherSample& sample : scenario.weather) table_.push_back(row_from(sample));
  live_.reserve(kMaxLiveSamples);
}

bool Environment::append(const scene::WeatherSample& sample) noexcept {
  if (live_.size() == kMaxLiveSamples) return false;
  if (!live_.empty() && sample.sim_time_ns < live_.back().time_ns) return false;
  live_.push_back(row_from(sample));
  return true;
}

physics::SunPosition Environment::sun_at(std::int64_t sim_time_ns) const noexcept {
  return physics::sun_position(epoch_utc_ns_ + sim_time_ns, place_);
}

physics::Forcing Environment::forcing_at(std::int64_t sim_time_ns,
                                         const physics::SunPosition& sun) const noexcept {
  const auto after = std::upper_bound(
      live_.begin(), live_.end(), sim_time_ns,
      [](std::int64_t t, const physics::WeatherRow& row) { return t < row.time_ns; });
  if (after != live_.begin()) return physics::forcing_from_rows({&*(after - 1), 1}, sim_time_ns);
  if (!table_.empty()) return physics::forcing_from_rows(table_, sim_time_ns);
  return physics::forcing_from_clear_sky(clear_sky_, place_, sun, epoch_utc_ns_ + sim_time_ns);
}

}  // namespace emit::renderer
