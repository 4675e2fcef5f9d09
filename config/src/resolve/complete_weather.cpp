// SPDX-License-Identifier: Apache-2.0
#include "complete_weather.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/physics/limits.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"
#include "keys/node.hpp"
#include "tables/weather_gaps.hpp"

namespace emit::config {

using physics::ClearSky;
using physics::WeatherSample;

namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr std::int64_t kDayNs = 86'400 * kSecondNs;
/// Rows that the clear-sky models make: the sun's curve bends little in a quarter of an hour.
constexpr std::int64_t kFillStepNs = 900 * kSecondNs;
/// Longer fills have a row per hour, and the longest bounds their number.
constexpr std::int64_t kLongFillNs = 60 * kDayNs;
constexpr std::int64_t kLongFillStepNs = 3600 * kSecondNs;
constexpr std::int64_t kLongestFillNs = 400 * kDayNs;

double seconds(std::int64_t ns) {
  return static_cast<double>(ns) / 1e9;  // rounded once, so that whole seconds print as such
}

/// Duration in the unit a reader expects.
std::string duration(std::int64_t ns) {
  const double s = seconds(ns);
  if (s >= 2.0 * 86'400.0) return fmt::format("{:.3g} days", s / 86'400.0);
  if (s >= 2.0 * 3600.0) return fmt::format("{:.3g} h", s / 3600.0);
  if (s >= 120.0) return fmt::format("{:.3g} min", s / 60.0);
  return fmt::format("{:.3g} s", s);
}

/// The clear-sky models at a place over simulation time.
class ModelSky {
 public:
  explicit ModelSky(const scene::ScenarioDesc& scenario)
      : place_{physics::Radians(scenario.place.lat_rad), physics::Radians(scenario.place.lon_rad),
               physics::Metres(scenario.place.height_m)},
        epoch_utc_ns_(scenario.epoch_utc_ns) {}

  [[nodiscard]] WeatherSample at(const ClearSky& model, std::int64_t sim_time_ns) const {
    const std::int64_t utc_ns = epoch_utc_ns_ + sim_time_ns;
    const physics::Forcing f = physics::forcing_from_clear_sky(
        model, place_, physics::sun_position(utc_ns, place_), utc_ns);
    WeatherSample out;
    out.sim_time_ns = sim_time_ns;
    out.direct_normal_w_m2 = f.direct_normal_w_m2;
    out.diffuse_horizontal_w_m2 = f.diffuse_horizontal_w_m2;
    out.longwave_down_w_m2 = f.longwave_down_w_m2;
    out.air_k = f.air_k;
    out.wind_m_s = f.wind_m_s;
    out.cloud_frac = f.cloud_frac;
    out.wind_from_rad = model.wind_from_rad;
    return out;
  }
  /// The cosine of the daily course of the air temperature.
  [[nodiscard]] double daily_cosine(std::int64_t sim_time_ns) const {
    const double hours = physics::mean_solar_hours(epoch_utc_ns_ + sim_time_ns, place_.longitude);
    return physics::daily_air_temperature(hours, physics::Kelvin(0.0), physics::Kelvin(1.0))
        .value();
  }

 private:
  physics::GeoPlace place_;
  std::int64_t epoch_utc_ns_;
};

double mean(std::span<const WeatherSample> rows, double WeatherSample::*member) {
  double sum = 0.0;
  for (const WeatherSample& row : rows) sum += row.*member;
  return sum / static_cast<double>(rows.size());
}

/// Mean and amplitude of the air temperature by least squares. Less than half a day does not show
/// the amplitude, so that only the mean is fitted then.
void fit_air(std::span<const WeatherSample> rows, const ModelSky& sky, const StatedClearSky& stated,
             ClearSky& model) {
  const auto count = static_cast<double>(rows.size());
  double cosines = 0.0;
  double squares = 0.0;
  double products = 0.0;
  for (const WeatherSample& row : rows) {
    const double c = sky.daily_cosine(row.sim_time_ns);
    cosines += c;
    squares += c * c;
    products += c * row.air_k;
  }
  const double air_sum = mean(rows, &WeatherSample::air_k) * count;
  const double spread = squares - cosines * cosines / count;
  const bool long_enough = rows.back().sim_time_ns - rows.front().sim_time_ns >= kDayNs / 2;
  if (!stated.air_amplitude && long_enough) {
    const double excess = stated.air_mean ? products - model.air_mean_k * cosines
                                          : products - cosines * air_sum / count;
    const double weight = stated.air_mean ? squares : spread;
    if (weight > 0.0) model.air_amplitude_k = std::clamp(excess / weight, 0.0, 40.0);
  }
  if (!stated.air_mean) {
    model.air_mean_k = std::clamp((air_sum - model.air_amplitude_k * cosines) / count,
                                  physics::limits::kAirK.lo, physics::limits::kAirK.hi);
  }
}

/// Share of the direct sun that clouds take: what the table's sun lacks of the clear sky's.
double fit_cloud_frac(std::span<const WeatherSample> rows, const ModelSky& sky, ClearSky model) {
  model.cloud_frac = 0.0;
  double measured_w_m2 = 0.0;
  double clear_w_m2 = 0.0;
  for (const WeatherSample& row : rows) {
    measured_w_m2 += row.direct_normal_w_m2 * (1.0 - row.cloud_frac);
    clear_w_m2 += sky.at(model, row.sim_time_ns).direct_normal_w_m2;
  }
  // A table of a night says nothing about the sun.
  if (clear_w_m2 < 100.0) return mean(rows, &WeatherSample::cloud_frac);
  return std::clamp(1.0 - measured_w_m2 / clear_w_m2, 0.0, 1.0);
}

/// The dew point for which the sky's emissivity gives the table's long-wave irradiance: the inverse
/// of physics::sky_longwave_w_m2() within its range of 230 to 310 K.
double fit_dew_point_k(std::span<const WeatherSample> rows, const ClearSky& model) {
  double black_w_m2 = 0.0;
  for (const WeatherSample& row : rows) {
    black_w_m2 += physics::kStefanBoltzmannWPerM2K4 * std::pow(row.air_k, 4.0);
  }
  const double measured_frac = mean(rows, &WeatherSample::longwave_down_w_m2) *
                               static_cast<double>(rows.size()) / black_w_m2;
  double lo_k = 230.0;
  double hi_k = std::clamp(model.air_mean_k + model.air_amplitude_k, lo_k, 310.0);
  for (int i = 0; i < 50; ++i) {
    const double mid_k = 0.5 * (lo_k + hi_k);
    const double frac =
        physics::sky_longwave_w_m2(physics::Kelvin(model.air_mean_k), physics::Kelvin(mid_k),
                                   model.cloud_frac, model.cloud_base) /
        (physics::kStefanBoltzmannWPerM2K4 * std::pow(model.air_mean_k, 4.0));
    (frac < measured_frac ? lo_k : hi_k) = mid_k;
  }
  return 0.5 * (lo_k + hi_k);
}

/// Mean vapour pressure of the rows that state a humidity; nothing if none does.
std::optional<double> mean_vapour_pa(std::span<const WeatherSample> rows) {
  double sum_pa = 0.0;
  double count = 0.0;
  for (const WeatherSample& row : rows) {
    if (!row.relative_humidity_frac) continue;
    sum_pa += *row.relative_humidity_frac * physics::saturation_over_water_pa(row.air_k);
    count += 1.0;
  }
  return count > 0.0 ? std::optional(sum_pa / count) : std::nullopt;
}

/// Parameters of the clear-sky models that go on from these rows.
ClearSky fitted(std::span<const WeatherSample> rows, const ModelSky& sky,
                const StatedClearSky& stated, ClearSky model) {
  fit_air(rows, sky, stated, model);
  if (!stated.wind) model.wind_m_s = mean(rows, &WeatherSample::wind_m_s);
  if (!stated.cloud) model.cloud_frac = fit_cloud_frac(rows, sky, model);
  if (!stated.dew_point) model.dew_point_k = fit_dew_point_k(rows, model);
  return model;
}

/// Leaves out the rain of the first row and warns of it: rain counts since the row before, so
/// nobody knows when this rain began.
void leave_out_first_rain(std::string_view name, scene::ScenarioDesc& scenario) {
  WeatherSample& first = scenario.weather.front();
  if (!(first.rain_mm_h > 0.0)) return;
  scenario.warnings.push_back(
      fmt::format("{}: the first row ({} s) states rain of {:.3g} mm/h, which is left out: "
                  "'rain_mm_h' counts since the row before, and there is none",
                  name, seconds(first.sim_time_ns), first.rain_mm_h));
  first.rain_mm_h = 0.0;
}

/// Warns of the gaps from `from_ns` on.
void report_gaps(std::string_view name, std::int64_t from_ns, std::int64_t usual_ns,
                 scene::ScenarioDesc& scenario) {
  const std::vector<WeatherSample>& rows = scenario.weather;
  constexpr std::size_t kMaxListed = 3;
  const std::vector<std::size_t> gaps = weather_gaps(rows, from_ns);
  if (gaps.empty()) return;
  std::string listed;
  for (std::size_t k = 0; k < std::min(gaps.size(), kMaxListed); ++k) {
    const std::int64_t begin_ns = rows[gaps[k] - 1].sim_time_ns;
    const std::int64_t end_ns = rows[gaps[k]].sim_time_ns;
    listed += fmt::format("{}from {} s to {} s ({})", listed.empty() ? "" : ", ", seconds(begin_ns),
                          seconds(end_ns), duration(end_ns - begin_ns));
  }
  if (gaps.size() > kMaxListed) {
    listed += fmt::format(" and {} more", gaps.size() - kMaxListed);
  }
  scenario.warnings.push_back(
      fmt::format("{}: the weather has no rows {}; the usual spacing is {} s ({}). In between the "
                  "weather is taken as linear",
                  name, listed, seconds(usual_ns), duration(usual_ns)));
}

}  // namespace

bool complete_weather(std::string_view name, const StatedClearSky& stated,
                      scene::ScenarioDesc& scenario) {
  std::vector<WeatherSample>& rows = scenario.weather;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    EMIT_CHECK_OP(rows[i - 1].sim_time_ns, <, rows[i].sim_time_ns);
  }
  // One row is constant weather, at all times.
  if (rows.size() < 2) return false;
  const std::int64_t history_ns = scenario.thermal.history_start_ns;
  const std::int64_t from_ns = history_ns - scenario.thermal.spin_up_ns;
  const std::int64_t first_ns = rows.front().sim_time_ns;
  const std::int64_t last_ns = rows.back().sim_time_ns;
  const ModelSky sky(scenario);
  const std::string spans = fmt::format(
      "the weather covers {} s to {} s ({} to {}), but the thermal simulation needs it from {} s "
      "({}) to the frame's time",
      seconds(first_ns), seconds(last_ns), toml_instant(scenario.epoch_utc_ns + first_ns),
      toml_instant(scenario.epoch_utc_ns + last_ns), seconds(from_ns),
      toml_instant(scenario.epoch_utc_ns + from_ns));

  const auto first_day_end =
      std::ranges::upper_bound(rows, first_ns + kDayNs, {}, &WeatherSample::sim_time_ns);
  if (last_ns <= from_ns || first_ns - from_ns > kLongestFillNs) {
    const auto last_day =
        std::ranges::lower_bound(rows, last_ns - kDayNs, {}, &WeatherSample::sim_time_ns);
    const std::span<const WeatherSample> nearest_day = last_ns <= from_ns
                                                           ? std::span(last_day, rows.end())
                                                           : std::span(rows.begin(), first_day_end);
    scenario.clear_sky = fitted(nearest_day, sky, stated, scenario.clear_sky);
    rows.clear();
    scenario.warnings.push_back(
        fmt::format("{}: {}. The clear-sky models make all of the weather", name, spans));
    return true;
  }
  leave_out_first_rain(name, scenario);
  const std::int64_t usual_ns = usual_spacing_ns(rows);
  report_gaps(name, from_ns, usual_ns, scenario);
  // Over less than one step the first row may stand in.
  if (first_ns - from_ns <= usual_ns) return false;

  scenario.clear_sky =
      fitted(std::span(rows.begin(), first_day_end), sky, stated, scenario.clear_sky);
  // The made weather keeps the vapour of the table's first day, as far as its air can hold it.
  const std::optional<double> vapour_pa = mean_vapour_pa(std::span(rows.begin(), first_day_end));
  std::vector<WeatherSample> made;
  const std::int64_t step_ns = first_ns - from_ns > kLongFillNs ? kLongFillStepNs : kFillStepNs;
  // The weather passes into the table over the last, shorter step.
  for (std::int64_t at_ns = from_ns; at_ns < first_ns; at_ns += step_ns) {
    WeatherSample& row = made.emplace_back(sky.at(scenario.clear_sky, at_ns));
    if (vapour_pa) {
      row.relative_humidity_frac =
          std::min(1.0, *vapour_pa / physics::saturation_over_water_pa(row.air_k));
    }
  }
  rows.insert(rows.begin(), made.begin(), made.end());
  scenario.warnings.push_back(fmt::format(
      "{}: {}. The clear-sky models make the weather before {} s", name, spans, seconds(first_ns)));
  return true;
}

}  // namespace emit::config
