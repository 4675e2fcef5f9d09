// SPDX-License-Identifier: Apache-2.0
#include "tool/logger/ground_signs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <string_view>

#include "emit/physics/constants.hpp"
#include "emit/scene/melting.hpp"

namespace emit::tool {
namespace {

using reference::LoggerRow;

constexpr double kFreezingK = 273.15;
constexpr double kDaylightWM2 = 100.0;

/// Dew or frost point of air, K (Magnus; over ice below 0 C).
double dew_point_k(double air_k, double rh_frac) {
  const double air_c = air_k - kFreezingK;
  const double log_ratio = std::log(std::max(rh_frac, 1e-3)) + 17.62 * air_c / (243.12 + air_c);
  const double dew_c = 243.12 * log_ratio / (17.62 - log_ratio);
  if (dew_c >= 0.0) return dew_c + kFreezingK;
  const double log_ice = std::log(std::max(rh_frac, 1e-3)) + 17.62 * air_c / (243.12 + air_c);
  return 272.62 * log_ice / (22.46 - log_ice) + kFreezingK;
}

/// Returns the first of `words` that the text has as a whole word and without "no " before it or
/// "-free" behind it, or nothing.
std::string_view stated_word(const std::string& text,
                             std::initializer_list<std::string_view> words) {
  std::string lower;
  for (const char c : text) lower += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  const auto is_letter = [&](std::size_t i) {
    return i < lower.size() && std::isalpha(static_cast<unsigned char>(lower[i])) != 0;
  };
  for (const std::string_view word : words) {
    for (std::size_t at = lower.find(word); at != std::string::npos;
         at = lower.find(word, at + 1)) {
      if ((at > 0 && is_letter(at - 1)) || is_letter(at + word.size())) continue;
      const std::string_view rest = std::string_view(lower).substr(at + word.size());
      const std::string_view before = std::string_view(lower).substr(0, at);
      const bool denied = rest.starts_with("-free") || rest.starts_with(" free") ||
                          before.ends_with("no ") || before.ends_with("without ") ||
                          before.ends_with("not ");
      if (!denied) return word;
    }
  }
  return {};
}

/// Seconds that row i stands for: half of the way to both neighbours.
double share_s(const std::vector<LoggerRow>& rows, std::size_t i) {
  const double before = i > 0 ? rows[i].time_s - rows[i - 1].time_s : 0.0;
  const double after = i + 1 < rows.size() ? rows[i + 1].time_s - rows[i].time_s : 0.0;
  return 0.5 * (before + after);
}

/// Hours for which `holds(i)` is true.
double hours_of(const std::vector<LoggerRow>& rows, const auto& holds) {
  double sum_s = 0.0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (holds(i)) sum_s += share_s(rows, i);
  }
  return sum_s / 3600.0;
}

void add_signs_of_words(const LoggerRecord& record, const MeasuredGround& ground,
                        std::vector<GroundSign>& signs) {
  const std::string_view plant = stated_word(
      record.words, {"grass",     "lawn",    "pasture", "meadow",    "crop",     "crops",
                     "canopy",    "forest",  "corn",    "soybeans",  "wheat",    "vegetation",
                     "grassland", "prairie", "savanna", "shrubland", "cropland", "alfalfa",
                     "clover",    "hay",     "heath",   "moss",      "weeds"});
  const bool evaporates = !ground.setup.moisture.dry() || ground.measured_evaporation;
  if (!plant.empty() && ground.measured_evaporation) {
    signs.push_back({"vegetation",
                     fmt::format("the file speaks of '{}': its evaporation is measured, but leaves "
                                 "are not layers of soil",
                                 plant),
                     false});
  } else if (!plant.empty() && evaporates) {
    signs.push_back({"vegetation",
                     fmt::format("the file speaks of '{}': plants evaporate as material '{}' "
                                 "states, which is not measured, and their leaves are not layers "
                                 "of soil",
                                 plant, ground.material.name),
                     false});
  } else if (!plant.empty()) {
    signs.push_back({"vegetation",
                     fmt::format("the file speaks of '{}': plants evaporate, and their leaves are "
                                 "not layers of soil",
                                 plant)});
  }
  const std::string_view wet = stated_word(
      record.words, {"moist", "wet", "irrigated", "rain", "rainy", "flooded", "marsh", "swamp",
                     "wetland", "bog", "fen", "peat", "damp", "saturated", "waterlogged", "paddy"});
  if (!wet.empty()) {
    signs.push_back(
        {"wet",
         evaporates
             ? fmt::format("the file speaks of '{}': how water moves the conductivity of the "
                           "ground is not known",
                           wet)
             : fmt::format("the file speaks of '{}': wet ground evaporates, dry layers do not",
                           wet),
         !evaporates});
  }
  const std::string_view snow = stated_word(
      record.words,
      {"snow", "snowy", "snowing", "snowfall", "snowpack", "ice", "icy", "frost", "glacier"});
  if (!snow.empty()) {
    signs.push_back({"snow", fmt::format("the file speaks of '{}': snow melts and lets sun in, "
                                         "which dry layers do not",
                                         snow)});
  } else if (scene::is_snow_or_ice(ground.material)) {
    signs.push_back({"snow", fmt::format("material '{}' melts and lets sun in, which dry layers "
                                         "do not",
                                         ground.material.name)});
  }
  // Moist ground is computed as dry layers where the humidity of the air is not known.
  const bool holds = evaporates || scene::moisture_of(ground.material).dry();
  if (!holds) {
    signs.push_back(
        {"humidity", fmt::format("material '{}' evaporates, but the record has no humidity "
                                 "(rh_pct): it counts as dry layers",
                                 ground.material.name)});
  }
  if (ground.material.dry_layers_valid) return;
  signs.push_back(
      {"material", fmt::format("material '{}' is not valid as dry layers", ground.material.name)});
}

/// Names a sun that does not stand where time, place and date have it.
void add_signs_of_sun(const LoggerRecord& record, std::vector<GroundSign>& signs) {
  constexpr const char* kCause =
      "its time is not UTC, or place or date are not those of the record";
  constexpr double kMostDarkFrac = 0.02;
  if (record.dark_sun_frac && *record.dark_sun_frac > kMostDarkFrac) {
    signs.push_back(
        {"sun", fmt::format("{:.0f} % of the sun came while it stood below the horizon: {}",
                            100.0 * *record.dark_sun_frac, kCause)});
  }
  // Good stations close within 5 %, most of it at low sun.
  constexpr double kMostOpenFrac = 0.15;
  if (record.sun_gap_frac && *record.sun_gap_frac > kMostOpenFrac) {
    signs.push_back({"sun", fmt::format("direct and diffuse sun add up to something that differs "
                                        "from the global sun by {:.0f} % on average: {}",
                                        100.0 * *record.sun_gap_frac, kCause)});
  }
}

void add_signs_of_moisture(const LoggerRecord& record, const MeasuredGround& ground,
                           const DayHeat& heat, std::vector<GroundSign>& signs) {
  const bool breaks = ground.setup.moisture.dry() && !ground.measured_evaporation;
  double latent_w_m2 = 0.0;
  double hours = 0.0;
  for (std::size_t i = 0; i < record.latent_w_m2.size(); ++i) {
    if (record.rows[i].sun_w_m2 < kDaylightWM2 || std::isnan(record.latent_w_m2[i])) continue;
    latent_w_m2 += record.latent_w_m2[i] * share_s(record.rows, i) / 3600.0;
    hours += share_s(record.rows, i) / 3600.0;
  }
  constexpr double kMuchWM2 = 20.0;
  if (hours > 0.0 && latent_w_m2 / hours > kMuchWM2) {
    signs.push_back(
        {"evaporation",
         fmt::format("evaporation takes {:.0f} W/m2 by day, measured{}", latent_w_m2 / hours,
                     ground.measured_evaporation ? ": the ground loses it, known to 20 %" : ""),
         breaks});
  } else if (heat.hours > 0.0 && heat.least_missing_w_m2 > kMuchWM2 &&
             heat.least_missing_w_m2 > 0.1 * heat.net_radiation_w_m2) {
    signs.push_back(
        {"evaporation",
         fmt::format("by day {:.0f} of {:.0f} W/m2 of net radiation go neither to the air ({:.0f}) "
                     "nor into dry layers ({:.0f}), and {:.0f} with a film 30 % and an "
                     "inertia 40 % greater: evaporation is likely, "
                     "unless the ground is another one",
                     heat.missing_w_m2, heat.net_radiation_w_m2, heat.to_air_w_m2,
                     heat.to_ground_w_m2, heat.least_missing_w_m2),
         breaks});
  }
  if (record.rh_frac.empty()) return;
  const double wet_h =
      hours_of(record.rows, [&](std::size_t i) { return record.rh_frac[i] > 0.97; });
  if (wet_h > 2.0) {
    signs.push_back(
        {"wet", fmt::format("humidity above 97 % for {:.1f} h: fog, rain or dew", wet_h), false});
  }
  const double dew_h = hours_of(record.rows, [&](std::size_t i) {
    return record.rows[i].surface_k < dew_point_k(record.rows[i].air_k, record.rh_frac[i]) - 0.5;
  });
  if (dew_h > 0.5) {
    signs.push_back({"dew",
                     fmt::format("the surface lies below the dew or frost point of the air for "
                                 "{:.1f} h: deposits release heat that the model lacks",
                                 dew_h),
                     false});
  }
}

}  // namespace

physics::Result<DayHeat> day_heat(const LoggerRecord& record, const MeasuredGround& ground) {
  MeasuredGround most = ground;
  most.numbers.inertia_factor *= 1.4;
  most.numbers.film_factor *= 1.3;
  const auto into_ground = reference::ground_heat_w_m2(ground.setup, record.rows, ground.numbers);
  if (!into_ground) return tl::unexpected(into_ground.error());
  const auto into_most = reference::ground_heat_w_m2(most.setup, record.rows, most.numbers);
  if (!into_most) return tl::unexpected(into_most.error());
  const auto films = reference::measured_films_w_m2_k(ground.setup, record.rows, ground.numbers);
  const auto most_films = reference::measured_films_w_m2_k(most.setup, record.rows, most.numbers);
  DayHeat out;
  double seconds = 0.0;
  for (std::size_t i = 0; i < record.rows.size(); ++i) {
    const LoggerRow& row = record.rows[i];
    if (row.sun_w_m2 < kDaylightWM2) continue;
    const double weight_s = share_s(record.rows, i);
    const double net_w_m2 = ground.numbers.absorptance_frac * row.sun_w_m2 +
                            ground.numbers.emissivity_frac *
                                (row.longwave_down_w_m2 -
                                 physics::kStefanBoltzmannWPerM2K4 * std::pow(row.surface_k, 4.0));
    const double air_w_m2 = films[i] * (row.surface_k - row.air_k);
    const double most_air_w_m2 = most_films[i] * (row.surface_k - row.air_k);
    seconds += weight_s;
    out.net_radiation_w_m2 += weight_s * net_w_m2;
    out.to_air_w_m2 += weight_s * air_w_m2;
    out.to_ground_w_m2 += weight_s * (*into_ground)[i];
    out.least_missing_w_m2 +=
        weight_s * (net_w_m2 - std::max(air_w_m2, most_air_w_m2) - (*into_most)[i]);
  }
  if (seconds <= 0.0) return out;
  for (double* mean :
       {&out.net_radiation_w_m2, &out.to_air_w_m2, &out.to_ground_w_m2, &out.least_missing_w_m2}) {
    *mean /= seconds;
  }
  out.missing_w_m2 = out.net_radiation_w_m2 - out.to_air_w_m2 - out.to_ground_w_m2;
  out.hours = seconds / 3600.0;
  return out;
}

std::vector<GroundSign> fit_signs(const LoggerRecord& record, const MeasuredGround& ground,
                                  const reference::PlateFit& fit) {
  std::vector<GroundSign> signs;
  double mean_k = 0.0;
  for (const LoggerRow& row : record.rows) mean_k += row.surface_k;
  mean_k /= static_cast<double>(record.rows.size());
  constexpr double kFarBaseK = 25.0;
  constexpr double kFarAbsorptance = 0.15;
  for (const reference::PlateEstimate& estimate : fit.estimates) {
    const char* const name = reference::name_of(estimate.number);
    const reference::PlateRange range = reference::range_of(estimate.number);
    const double margin = 1e-3 * (range.high - range.low);
    if (estimate.value < range.low + margin || estimate.value > range.high - margin) {
      signs.push_back({"fit", fmt::format("{} stopped at {:.4g}, the end of its range: the record "
                                          "asks for something else than these numbers",
                                          name, estimate.value)});
    } else if (estimate.number == reference::PlateNumber::base &&
               std::abs(estimate.value - mean_k) > kFarBaseK) {
      signs.push_back({"fit", fmt::format("{} is {:.0f} K from the mean of the surface: it makes "
                                          "up for something else",
                                          name, std::abs(estimate.value - mean_k))});
    } else if (estimate.number == reference::PlateNumber::absorptance &&
               ground.absorptance_measured && record.reflected_frac &&
               std::abs(estimate.value - 1.0 + *record.reflected_frac) > kFarAbsorptance) {
      signs.push_back({"fit", fmt::format("{} {:.2f} is fitted, but the reflected sun says {:.2f}",
                                          name, estimate.value, 1.0 - *record.reflected_frac)});
    }
  }
  // Below this the correlation of the residuals is itself hardly known, and intervals that should
  // hold in 99 of 100 records held in 79 of 90.
  constexpr double kFewRows = 12.0;
  if (!fit.estimates.empty() && fit.independent_rows < kFewRows) {
    signs.push_back({"fit",
                     fmt::format("residuals change slowly, so that the record counts as {:.0f} "
                                 "independent rows: the intervals may be too narrow",
                                 fit.independent_rows),
                     false});
  }
  return signs;
}

std::vector<GroundSign> ground_signs(const LoggerRecord& record, const MeasuredGround& ground,
                                     const DayHeat& heat) {
  std::vector<GroundSign> signs;
  add_signs_of_words(record, ground, signs);
  add_signs_of_sun(record, signs);
  constexpr double kSnowAlbedo = 0.4;
  if (record.reflected_frac && *record.reflected_frac > kSnowAlbedo) {
    signs.push_back({"snow", fmt::format("the ground reflects {:.2f} of the sun: snow, ice or salt",
                                         *record.reflected_frac)});
  }
  add_signs_of_moisture(record, ground, heat, signs);
  const auto [coldest, warmest] = std::ranges::minmax_element(
      record.rows, {}, [](const LoggerRow& row) { return row.surface_k; });
  const double frozen_h =
      hours_of(record.rows, [&](std::size_t i) { return record.rows[i].surface_k < kFreezingK; });
  constexpr double kLongH = 0.5;
  if (!ground.setup.moisture.dry() && frozen_h > kLongH) {
    signs.push_back(
        {"freezing", fmt::format("moist ground is below 0 C for {:.1f} h, down to {:.1f} K: "
                                 "freezing takes no heat in the model, and ice sublimates as water "
                                 "does",
                                 frozen_h, coldest->surface_k)});
  } else if (coldest->surface_k < kFreezingK - 1.0 && warmest->surface_k > kFreezingK + 1.0) {
    signs.push_back({"freezing",
                     fmt::format("the surface goes from {:.1f} to {:.1f} K: water in the ground "
                                 "freezes and thaws, which the model lacks",
                                 coldest->surface_k, warmest->surface_k),
                     false});
  }
  const double thawed_h =
      hours_of(record.rows, [&](std::size_t i) { return record.rows[i].surface_k > kFreezingK; });
  if (scene::is_snow_or_ice(ground.material) && thawed_h > kLongH) {
    signs.push_back(
        {"melting", fmt::format("'{}' is above 0 C for {:.1f} h, up to {:.1f} K: melting takes no "
                                "heat in the model",
                                ground.material.name, thawed_h, warmest->surface_k)});
  }
  constexpr double kMostWindMS = 20.0;
  const double stormy_h = hours_of(record.rows, [&](std::size_t i) {
    return record.rows[i].wind_m_s > kMostWindMS && record.rows[i].film_w_m2_k <= 0.0;
  });
  if (stormy_h > 0.0) {
    signs.push_back({"wind",
                     fmt::format("wind above 20 m/s for {:.1f} h, beyond the measurements of the "
                                 "air film",
                                 stormy_h),
                     false});
  }
  const double record_h = (record.rows.back().time_s - record.rows.front().time_s) / 3600.0;
  const double calm_h = hours_of(record.rows, [&](std::size_t i) {
    return record.rows[i].wind_m_s < 1.0 && record.rows[i].film_w_m2_k <= 0.0;
  });
  if (calm_h > 0.2 * record_h) {
    signs.push_back({"calm",
                     fmt::format("wind below 1 m/s for {:.1f} of {:.1f} h: the film is that of "
                                 "natural convection, and of stable air at night, where a station "
                                 "says least",
                                 calm_h, record_h),
                     false});
  }
  return signs;
}

}  // namespace emit::tool
