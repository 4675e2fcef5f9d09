// SPDX-License-Identifier: Apache-2.0
// Surfaces that nobody has stated a temperature for begin in the balance of their own first day.
// The judge is a run over hundreds of equal days from a wrong temperature.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <map>
#include <numbers>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/reference/surface_forcing.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "history/opening_states.hpp"

namespace emit {
namespace {

constexpr std::int64_t kOneHourNs = 3'600'000'000'000;
constexpr std::int64_t kOneDayNs = 24 * kOneHourNs;
const glm::dvec3 kLevel(0.0, 0.0, 1.0);

scene::Material ground(const std::string& name, std::vector<scene::Layer> layers) {
  scene::Material out;
  out.name = name;
  out.solar_absorptance_frac = 0.9;
  out.emissivity_frac = 0.93;
  out.layers = std::move(layers);
  out.base_k = 284.0;
  return out;
}

/// Returns a scenario whose days are all equal: the sun only lights the sky, because that of the
/// seasons would not repeat itself.
scene::ScenarioDesc equal_days(std::int64_t first_day, std::int64_t last_day) {
  scene::ScenarioDesc scenario;
  scenario.place = {0.0, 0.0, 0.0};
  scenario.materials = {ground("asphalt", {{0.15, 0.7, 2120.0, 920.0}, {2.0, 1.5, 2000.0, 950.0}}),
                        ground("soil", {{1.0, 0.4, 1500.0, 900.0}}),
                        ground("slab", {{0.03, 1.4, 2300.0, 900.0}})};
  scenario.default_material = "asphalt";
  scenario.thermal.model = scene::ThermalModel::foster;
  for (std::int64_t hour = 24 * first_day; hour <= 24 * last_day; ++hour) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(hour) / 24.0;
    physics::WeatherSample row;
    row.sim_time_ns = hour * kOneHourNs;
    row.air_k = 293.0 + 6.0 * std::sin(angle);
    row.diffuse_horizontal_w_m2 = std::max(0.0, 800.0 * std::sin(angle + 0.5));
    row.longwave_down_w_m2 = 330.0 + 20.0 * std::sin(angle);
    row.wind_m_s = 3.0;
    row.environment_k = 300.0;
    scenario.weather.push_back(row);
  }
  return scenario;
}

reference::SurfaceClimate equal_climate(const scene::ScenarioDesc& scenario, std::int64_t end_ns) {
  reference::ClimateOptions options;
  options.end_ns = end_ns;
  options.step_s = 3600.0;
  auto climate = reference::SurfaceClimate::create(scenario, options);
  EXPECT_TRUE(climate.has_value()) << climate.error().text;
  return std::move(*climate);
}

/// Returns the forcing of the renderer over the half hours of the day from time 0 on.
physics::Result<std::vector<renderer::IntervalForcing>> day_of(
    const scene::ScenarioDesc& scenario) {
  std::vector<std::int64_t> nodes;
  for (std::int64_t half = 0; half <= 48; ++half) nodes.push_back(half * kOneHourNs / 2);
  return renderer::surface_forcing(scenario, nodes, scenario.materials);
}

struct Case {
  std::size_t material;
  double sky_frac;
};
constexpr Case kCases[] = {{0, 1.0}, {0, 0.2}, {1, 1.0}, {1, 0.6}, {2, 1.0}, {2, 0.3}};

/// The tests know two kinds of things that hide the sky above level ground.
enum class Hidden : std::uint8_t {
  surroundings,  ///< they reflect sunlight and have a temperature of their own
  shade,         ///< it is dark and as warm as the air
};

/// Returns the temperatures at the ends of the hours of a day after so many equal days from 284 K,
/// by the solver of layers.
std::vector<double> after_days(const Case& at, Hidden hidden, std::int64_t days) {
  scene::ScenarioDesc scenario = equal_days(-days, 1);
  scenario.thermal.history_start_ns = -days * kOneDayNs;
  const reference::SurfaceClimate climate = equal_climate(scenario, kOneDayNs);
  std::vector<std::int64_t> times;
  for (std::int64_t hour = 0; hour <= 24; ++hour) times.push_back(hour * kOneHourNs);
  std::vector<reference::ViewSample> view{{0, 1.0, at.sky_frac}};
  if (hidden == Hidden::shade) {
    view.clear();
    for (const physics::WeatherSample& row : scenario.weather) {
      const double frac = 1.0 - at.sky_frac;
      view.push_back({row.sim_time_ns, 1.0, at.sky_frac, frac, 0.0,
                      frac * physics::kStefanBoltzmannWPerM2K4 * std::pow(row.air_k, 4.0)});
    }
  }
  const auto kelvin =
      point_history(climate, scenario.materials[at.material], 284.0, kLevel, view, times);
  EXPECT_TRUE(kelvin.has_value());
  return kelvin.value_or(std::vector<double>(times.size()));
}

/// Returns what is left after so many days that no start counts.
const std::vector<double>& truth_of(const Case& at, Hidden hidden) {
  static std::map<std::tuple<std::size_t, double, Hidden>, std::vector<double>> known;
  std::vector<double>& out_k = known[{at.material, at.sky_frac, hidden}];
  if (out_k.empty()) out_k = after_days(at, hidden, 250);
  return out_k;
}

class BalancedStart : public ::testing::TestWithParam<Case> {};

TEST_P(BalancedStart, IsWhatHundredsOfEqualDaysLeaveInTheReference) {
  const std::vector<double>& truth_k = truth_of(GetParam(), Hidden::surroundings);
  // A day is spin-up in one run, and history in the other.
  for (const bool spins_up : {false, true}) {
    scene::ScenarioDesc from = equal_days(-2, 1);
    from.thermal.initial_stated = false;
    from.thermal.initial_k = 293.0;
    from.thermal.history_start_ns = spins_up ? 0 : -kOneDayNs;
    from.thermal.spin_up_ns = spins_up ? kOneDayNs : 0;
    const reference::SurfaceClimate climate = equal_climate(from, kOneDayNs);
    std::vector<std::int64_t> times;
    for (std::int64_t hour = 0; hour <= 24; ++hour) times.push_back(hour * kOneHourNs);
    const std::vector<reference::ViewSample> view{{0, 1.0, GetParam().sky_frac}};
    const auto kelvin =
        point_history(climate, from.materials[GetParam().material], 293.0, kLevel, view, times);
    ASSERT_TRUE(kelvin.has_value());
    for (std::size_t i = 0; i < times.size(); ++i) {
      EXPECT_NEAR((*kelvin)[i], truth_k[i], 0.05) << i << " h, spins up " << spins_up;
    }
  }
}

TEST_P(BalancedStart, IsWhatHundredsOfEqualDaysLeaveInTheRenderer) {
  const std::vector<double>& truth_k = truth_of(GetParam(), Hidden::shade);
  constexpr double kReferenceK = 300.0;
  const scene::ScenarioDesc scenario = equal_days(-1, 2);
  const auto day = day_of(scenario);
  ASSERT_TRUE(day.has_value());
  const auto materials = renderer::foster_materials(scenario.materials, {});
  ASSERT_TRUE(materials.has_value());
  const renderer::FosterMaterial& material = (*materials)[GetParam().material];
  renderer::OpeningStates states;
  states.resize(1);
  states.fill(0, material, *day, {}, kReferenceK);
  const auto offset_k = [&](const physics::FosterState<double>& x) {
    return physics::foster_offset_k(
        x, physics::foster_surface(material.network, material.emissivity_frac, material.base_k,
                                   kReferenceK));
  };
  // Midnight is what fast modes know. The mean of the day is what slow ones hold up.
  EXPECT_NEAR(kReferenceK + offset_k(states.at_start(0, 1.0, 0.0, GetParam().sky_frac)), truth_k[0],
              0.3);
}

INSTANTIATE_TEST_SUITE_P(Grounds, BalancedStart, ::testing::ValuesIn(kCases));

TEST(BalancedStartOfFaces, IsTheSteadyStateWithoutADay) {
  // Weather that never changes has a closed form: what reaches the face leaves it.
  constexpr double kReferenceK = 300.0;
  scene::ScenarioDesc scenario = equal_days(0, 1);
  for (physics::WeatherSample& row : scenario.weather) {
    const std::int64_t at_ns = row.sim_time_ns;
    row = scenario.weather.front();
    row.sim_time_ns = at_ns;
    row.diffuse_horizontal_w_m2 = 300.0;
    row.film_w_m2_k = 12.0;
  }
  const auto day = day_of(scenario);
  ASSERT_TRUE(day.has_value());
  const auto materials = renderer::foster_materials(scenario.materials, {});
  ASSERT_TRUE(materials.has_value());
  renderer::OpeningStates states;
  states.resize(materials->size());
  for (std::size_t m = 0; m < materials->size(); ++m) {
    const renderer::FosterMaterial& material = (*materials)[m];
    states.fill(m, material, *day, {}, kReferenceK);
    const auto surface = physics::foster_surface(material.network, material.emissivity_frac,
                                                 material.base_k, kReferenceK);
    for (const double sky_frac : {0.0, 0.5, 1.0}) {
      for (const double up : {-1.0, 0.0, 1.0}) {
        const double t =
            kReferenceK + physics::foster_offset_k(states.at_start(m, up, 0.0, sky_frac), surface);
        const renderer::SurfaceForcing& now = day->front().begin;
        // Things that hide the sky above the horizon are as warm as the air and reflect nothing.
        const double ground_frac = std::min(1.0 - sky_frac, 0.5 - 0.5 * up);
        const double above_frac = 1.0 - sky_frac - ground_frac;
        const double in_w_m2 =
            0.9 * (sky_frac * 300.0 + ground_frac * now.reflected_w_m2) +
            0.93 * (sky_frac * now.longwave_w_m2 + ground_frac * now.environment_w_m2 +
                    above_frac * physics::kStefanBoltzmannWPerM2K4 * std::pow(now.air_k, 4.0)) +
            12.0 * (now.air_k - t) - 0.93 * physics::kStefanBoltzmannWPerM2K4 * std::pow(t, 4.0);
        const double down_w_m2 = (t - material.base_k) / material.network.resistance_m2k_w();
        EXPECT_NEAR(in_w_m2, down_w_m2, 0.2) << m << " " << sky_frac << " " << up;
      }
    }
  }
}

}  // namespace
}  // namespace emit
