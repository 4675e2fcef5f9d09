// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/base.hpp"

#include <algorithm>

#include "emit/physics/climate/climate.hpp"

namespace emit::scene {
namespace {

constexpr std::int64_t kDayNs = 86'400'000'000'000;
/// Instants of a day at which the air of a weather table counts.
constexpr std::int64_t kPartsOfDay = 96;

/// Returns the layers above the base: emit2014 has the first alone.
std::vector<physics::StackLayer> stack_of(const Material& material, ThermalModel model) {
  std::vector<physics::StackLayer> stack;
  for (const Layer& layer : material.layers) {
    if (model == ThermalModel::emit2014 && !stack.empty()) break;
    stack.push_back({layer.thickness_m, layer.conductivity_w_m_k,
                     layer.density_kg_m3 * layer.specific_heat_j_kg_k});
  }
  return stack;
}

}  // namespace

double mean_air_k(const ScenarioDesc& scenario) noexcept {
  if (scenario.weather.empty()) return scenario.clear_sky.air_mean_k;
  double sum_k = 0.0;
  for (std::int64_t i = 0; i < kPartsOfDay; ++i) {
    const std::int64_t at_ns = -kDayNs / kPartsOfDay * i;
    sum_k += physics::forcing_from_rows(scenario.weather, at_ns).air_k;
  }
  return sum_k / kPartsOfDay;
}

double usual_dew_point_k(const ScenarioDesc& scenario) noexcept {
  return scenario.weather.empty() ? scenario.clear_sky.dew_point_k
                                  : physics::usual_dew_point_k(mean_air_k(scenario));
}

double base_temperature_k(const Material& material, const ScenarioDesc& scenario) {
  if (material.base != BaseKind::ground) return mean_air_k(scenario);
  const physics::GeoPlace place{physics::Radians(scenario.place.lat_rad),
                                physics::Radians(scenario.place.lon_rad),
                                physics::Metres(scenario.place.height_m)};
  const physics::AnnualAir air = physics::annual_air_of(scenario.weather, scenario.epoch_utc_ns)
                                     .value_or(physics::zonal_climate(place));
  return physics::ground_k(air, stack_of(material, scenario.thermal.model),
                           physics::day_of_year(scenario.epoch_utc_ns));
}

void resolve_bases(ScenarioDesc& scenario) {
  for (Material& material : scenario.materials) {
    if (material.base_stated || material.prescribed_k) continue;
    material.base_k = base_temperature_k(material, scenario);
  }
}

}  // namespace emit::scene
