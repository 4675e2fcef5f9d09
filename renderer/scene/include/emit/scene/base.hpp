// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

#include "emit/scene/scene_desc.hpp"

/// Temperature of what the last layer of a material rests on.
namespace emit::scene {

/// Returns the mean of the outdoor air over the day that ends at simulation time 0, K: of the
/// weather table, or of the clear-sky models without one.
[[nodiscard]] double mean_air_k(const ScenarioDesc& scenario) noexcept;

/// Length of the day in whose balance surfaces begin.
inline constexpr std::int64_t kBalancedDayNs = 86'400'000'000'000;
/// Returns whether surfaces that nobody has stated a temperature for begin in the balance of their
/// own first day: spin-up or history must have that day.
[[nodiscard]] constexpr bool starts_balanced(const ThermalOptions& options) noexcept {
  return options.model == ThermalModel::foster && !options.initial_stated &&
         (options.spin_up_ns >= kBalancedDayNs || options.history_start_ns <= -kBalancedDayNs);
}

/// Returns the dew point of the air where the weather states no humidity, K: that of the clear-sky
/// models, or beside a weather table that of 60 % at mean_air_k().
[[nodiscard]] double usual_dew_point_k(const ScenarioDesc& scenario) noexcept;

/// Returns Material::base_k for the kind of base of a material whose number the user does not
/// state: of the ground at the depth of its layers by place, date and weather, or mean_air_k().
[[nodiscard]] double base_temperature_k(const Material& material, const ScenarioDesc& scenario);

/// Gives every material of the scenario without a stated number the temperature of its base.
/// @pre place, epoch and weather of the scenario are set
void resolve_bases(ScenarioDesc& scenario);

}  // namespace emit::scene
