// SPDX-License-Identifier: Apache-2.0
#include "history/environment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "emit/scene/base.hpp"

namespace emit::renderer {
namespace {

bool same_weather(const physics::WeatherSample& a, const physics::WeatherSample& b) noexcept {
  return a.direct_normal_w_m2 == b.direct_normal_w_m2 &&
         a.diffuse_horizontal_w_m2 == b.diffuse_horizontal_w_m2 &&
         a.longwave_down_w_m2 == b.longwave_down_w_m2 && a.air_k == b.air_k &&
         a.wind_m_s == b.wind_m_s && a.cloud_frac == b.cloud_frac &&
         a.environment_k == b.environment_k && a.film_w_m2_k == b.film_w_m2_k &&
         a.wind_from_rad == b.wind_from_rad &&
         a.relative_humidity_frac == b.relative_humidity_frac && a.rain_mm_h == b.rain_mm_h;
}

}  // namespace

Environment::Environment(const scene::ScenarioDesc& scenario)
    : place_{physics::Radians(scenario.place.lat_rad), physics::Radians(scenario.place.lon_rad),
             physics::Metres(scenario.place.height_m)},
      epoch_utc_ns_(scenario.epoch_utc_ns),
      clear_sky_(scenario.clear_sky),
      table_(scenario.weather),
      usual_dew_point_k_(scene::usual_dew_point_k(scenario)),
      film_factor_(scenario.thermal.film_factor),
      clouds_(scenario.clouds ? physics::CloudField::shared(*scenario.clouds) : nullptr),
      table_rain_(scenario.weather) {
  live_rain_mm_.reserve(kMaxLiveSamples);
  live_.reserve(kMaxLiveSamples);
  changes_ns_.reserve(kMaxLiveSamples);
  revisions_.reserve(kMaxLiveSamples);
}

bool Environment::append(const physics::WeatherSample& row) noexcept {
  if (!live_.empty()) {
    if (row.sim_time_ns < live_.back().sim_time_ns) return false;
    if (same_weather(row, live_.back())) return true;
    if (row.sim_time_ns == live_.back().sim_time_ns) {
      live_.back() = row;
      live_rains_ = live_rains_ || row.rain_mm_h > 0.0;
      revisions_.back() = ++revision_;
      return true;
    }
  }
  if (live_.size() == kMaxLiveSamples) {
    const auto thin = [](auto& values) {
      const auto half = values.begin() + kMaxLiveSamples / 2;
      auto write = values.begin() + 1;
      for (auto read = values.begin() + 2; read < half; read += 2) *write++ = *read;
      values.erase(write, half);
    };
    thin(live_);
    thin(live_rain_mm_);
    thin(changes_ns_);
    thin(revisions_);
  }
  live_rain_mm_.push_back(rain_until_mm(row.sim_time_ns));
  live_rains_ = live_rains_ || row.rain_mm_h > 0.0;
  live_.push_back(row);
  revisions_.push_back(++revision_);
  changes_ns_.push_back(row.sim_time_ns);
  return true;
}

void Environment::reset() noexcept {
  if (!live_.empty()) reset_revision_ = ++revision_;
  live_.clear();
  live_rain_mm_.clear();
  live_rains_ = false;
  changes_ns_.clear();
  revisions_.clear();
}

std::int64_t Environment::changed_since_ns(std::uint64_t revision) const noexcept {
  using Limits = std::numeric_limits<std::int64_t>;
  if (revision_ == revision) return Limits::max();
  const auto first = std::ranges::upper_bound(revisions_, revision);
  if (reset_revision_ > revision || first == revisions_.end()) return Limits::min();
  return changes_ns_[static_cast<std::size_t>(first - revisions_.begin())];
}

double Environment::rain_until_mm(std::int64_t sim_time_ns) const noexcept {
  const auto after = std::ranges::upper_bound(changes_ns_, sim_time_ns);
  if (after == changes_ns_.begin()) return table_rain_.at_mm(sim_time_ns);
  const auto i = static_cast<std::size_t>(after - changes_ns_.begin()) - 1;
  // A live row rains until the next one. Where rows between were thinned out, the depths still
  // hold.
  constexpr double kNsPerH = 3.6e12;
  const double passed_ns = static_cast<double>(sim_time_ns - changes_ns_[i]);
  if (after == changes_ns_.end()) {
    return live_rain_mm_[i] + live_[i].rain_mm_h * passed_ns / kNsPerH;
  }
  return std::lerp(live_rain_mm_[i], live_rain_mm_[i + 1],
                   passed_ns / static_cast<double>(*after - changes_ns_[i]));
}

physics::SunPosition Environment::sun_at(std::int64_t sim_time_ns) const noexcept {
  return physics::sun_position(epoch_utc_ns_ + sim_time_ns, place_);
}

physics::Forcing Environment::forcing_at(std::int64_t sim_time_ns,
                                         const physics::SunPosition& sun) const noexcept {
  const auto after = std::upper_bound(
      live_.begin(), live_.end(), sim_time_ns,
      [](std::int64_t t, const physics::WeatherSample& row) { return t < row.sim_time_ns; });
  physics::Forcing forcing;
  if (after == live_.begin() && table_.empty()) {
    forcing = physics::forcing_from_clear_sky(clear_sky_, place_, sun, epoch_utc_ns_ + sim_time_ns);
    // The models have a dew point of their own.
    forcing.stated_vapour_pa = forcing.vapour_pa;
    forcing.stated_vapour_frac = 1.0;
  } else {
    forcing = after != live_.begin() ? physics::forcing_from_rows({&*(after - 1), 1}, sim_time_ns)
                                     : physics::forcing_from_rows(table_, sim_time_ns);
    forcing = physics::with_vapour(physics::at_place(forcing, place_, sun), usual_dew_point_k_);
  }
  forcing.film_factor = film_factor_;
  return forcing;
}

}  // namespace emit::renderer
