// SPDX-License-Identifier: Apache-2.0
#include "solve_limits.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <string_view>

#include "emit/physics/constants.hpp"
#include "emit/scene/melting.hpp"
#include "emit/scene/rain.hpp"

namespace emit::reference {
namespace {

constexpr double kSnowAirK = 274.15;
constexpr double kMostWindMS = 20.0;
constexpr double kLeastSkyFrac = 0.4;

/// Returns the names of materials, quoted.
std::string names_of(const std::vector<std::string_view>& names) {
  return fmt::format("'{}'", fmt::join(names, "', '"));
}

/// Returns whether a material gives water to the air, now or after rain.
bool may_be_wet(const scene::Material& material) {
  return !scene::moisture_of(material).dry() || !scene::water_store_of(material).none();
}

}  // namespace

std::vector<std::string> weather_limits(const scene::ScenarioDesc& scenario,
                                        const scene::SceneGeometry& geometry,
                                        std::span<const ClimateNode> nodes) {
  std::vector<std::string> out;
  double coldest_rain_k = kSnowAirK;
  double wind_m_s = 0.0;
  const ClimateNode* dark = nullptr;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const ClimateNode& node = nodes[i];
    const double black = physics::kStefanBoltzmannWPerM2K4 * std::pow(node.air_k, 4.0);
    if (dark == nullptr && node.longwave_down_w_m2 < kLeastSkyFrac * black) dark = &node;
    if (i > 0 && node.rain_mm > nodes[i - 1].rain_mm) {
      coldest_rain_k = std::min({coldest_rain_k, node.air_k, nodes[i - 1].air_k});
    }
    if (node.flow.stated_frac > 0.0) continue;
    wind_m_s = std::max(wind_m_s, glm::length(node.flow.flow_m_s));
  }
  for (const physics::WeatherSample& row : scenario.weather) {
    if (!row.film_w_m2_k) wind_m_s = std::max(wind_m_s, row.wind_m_s);
  }
  const bool rains = !nodes.empty() && nodes.back().rain_mm > nodes.front().rain_mm;
  if (coldest_rain_k < kSnowAirK) {
    out.push_back(
        fmt::format("snowfall: it rains at {:.1f} K: that is snow, which is not modelled "
                    "and counts as rain",
                    coldest_rain_k));
  }
  if (wind_m_s > kMostWindMS) {
    out.push_back(
        fmt::format("strong_wind: the wind reaches {:.1f} m/s, beyond the measurements of "
                    "the air film",
                    wind_m_s));
  }
  if (dark != nullptr) {
    out.push_back(fmt::format(
        "longwave_low: the weather's long-wave irradiance is {:.0f} W/m2 at {} s, below {} of a "
        "black sky's at {:.1f} K: it may be a gap",
        dark->longwave_down_w_m2, static_cast<double>(dark->time_ns) * 1e-9, kLeastSkyFrac,
        dark->air_k));
  }
  std::vector<std::string_view> guides;
  for (const scene::Material& material : geometry.materials) {
    if (!material.dry_layers_valid && !material.prescribed_k) guides.push_back(material.name);
  }
  if (!guides.empty()) {
    out.push_back(
        fmt::format("layers_invalid: {} {} dry_layers_valid = false: temperatures are a "
                    "guide only",
                    names_of(guides), guides.size() == 1 ? "states" : "state"));
  }
  std::vector<std::string_view> moist;
  for (const scene::Material& material : geometry.materials) {
    const bool wet = !scene::moisture_of(material).dry() ||
                     scene::water_store_of(material).initial_mm > 0.0 ||
                     (rains && may_be_wet(material));
    if (wet) moist.push_back(material.name);
  }
  const bool lacks = std::ranges::any_of(scenario.weather, [](const physics::WeatherSample& row) {
    return !row.relative_humidity_frac;
  });
  if (lacks && !moist.empty()) {
    out.push_back(
        fmt::format("humidity_unknown: the weather lacks the humidity that {} needs: 60 % "
                    "at the mean air counts",
                    names_of(moist)));
  }
  const std::vector<std::uint32_t> bare = scene::materials_without_rain(scenario.thermal, geometry);
  if (rains && !bare.empty()) {
    std::vector<std::string_view> names;
    for (const std::uint32_t m : bare) names.push_back(geometry.materials[m].name);
    out.push_back(
        fmt::format("rain_unknown: it rains on {} without 'water_store_mm', and rain "
                    "leaves that dry",
                    names_of(names)));
  }
  return out;
}

std::vector<std::string> temperature_limits(const scene::ScenarioDesc& scenario,
                                            const scene::SceneGeometry& geometry,
                                            std::span<const SolvedPlace> places,
                                            std::int64_t sim_time_ns) {
  const bool rains = std::ranges::any_of(
      scenario.weather, [](const physics::WeatherSample& row) { return row.rain_mm_h > 0.0; });
  std::map<std::uint32_t, std::pair<double, double>> range_k;
  for (const SolvedPlace& place : places) {
    if (!std::isfinite(place.kelvin)) continue;
    const auto [entry, made] =
        range_k.try_emplace(place.material, std::pair(place.kelvin, place.kelvin));
    entry->second.first = std::min(entry->second.first, place.kelvin);
    entry->second.second = std::max(entry->second.second, place.kelvin);
  }
  std::vector<std::string> out;
  for (const auto& [m, range] : range_k) {
    const scene::Material& material = geometry.materials[m];
    const double at_s = static_cast<double>(sim_time_ns) * 1e-9;
    const bool moist = !scene::moisture_of(material).dry() || (rains && may_be_wet(material));
    if (moist && range.first < physics::kZeroCelsiusK) {
      out.push_back(
          fmt::format("freezing: '{}' may be wet and goes down to {:.1f} K at {} s: "
                      "freezing takes no heat here, ice sublimates as water does",
                      material.name, range.first, at_s));
    }
    if (scene::is_snow_or_ice(material) && range.second > physics::kZeroCelsiusK) {
      out.push_back(
          fmt::format("melting: '{}' goes up to {:.1f} K at {} s: melting takes no heat "
                      "here, so that it is too warm",
                      material.name, range.second, at_s));
    }
  }
  return out;
}

}  // namespace emit::reference
