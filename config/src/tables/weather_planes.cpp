// SPDX-License-Identifier: Apache-2.0
#include "emit/config/weather_planes.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/climate/rain.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"
#include "tables.hpp"
#include "weather_year.hpp"

namespace emit::config {
namespace {

using physics::Result;

constexpr double kYearS = 365.0 * 86'400.0;

/// Rows of a file on the axis of simulation time, and the part of it that they describe.
struct RowsOfFile {
  std::vector<physics::WeatherSample> rows;
  WeatherOrigin origin;
  std::vector<std::string> warnings;
  double from_s = 0.0;
  double to_s = 0.0;
};

RowsOfFile rows_of_year(const WeatherYear& year, const std::string& name) {
  using namespace std::chrono;
  scene::ScenarioDesc scenario;
  scenario.place = {year.lat_deg * physics::kDegree, year.lon_deg * physics::kDegree,
                    year.height_m};
  auto first = std::chrono::year(year.records.front().year);
  while (first.is_leap()) ++first;
  const auto days = sys_days(first / January / 1).time_since_epoch();
  scenario.epoch_utc_ns =
      duration_cast<std::chrono::nanoseconds>(days).count() - std::llround(year.zone_h * 3.6e12);
  RowsOfFile out;
  out.rows = weather_of_year(year, name, scenario, out.warnings);
  out.origin = {scenario.place, scenario.epoch_utc_ns};
  out.to_s = kYearS;
  return out;
}

Result<RowsOfFile> rows_of(const std::filesystem::path& file,
                           const std::optional<WeatherOrigin>& origin) {
  if (is_weather_year(file)) {
    const auto year = load_weather_year(file);
    if (!year) return tl::unexpected<physics::Error>(year.error());
    return rows_of_year(*year, file.string());
  }
  auto rows = load_weather_csv(file);
  if (!rows) return tl::unexpected<physics::Error>(rows.error());
  if (!origin) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               file.string() + ": a table has no place, which the scenario states");
  }
  const auto seconds = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-9; };
  return RowsOfFile{
      *rows, *origin, {}, seconds(rows->front().sim_time_ns), seconds(rows->back().sim_time_ns)};
}

glm::dvec3 normal_of(const WeatherPlane& plane) {
  const double azimuth = plane.azimuth_deg * physics::kDegree;
  const double tilt = plane.tilt_deg * physics::kDegree;
  return {std::sin(tilt) * std::sin(azimuth), std::sin(tilt) * std::cos(azimuth), std::cos(tilt)};
}

}  // namespace

Result<PlaneCourse> weather_on_planes(const std::filesystem::path& file,
                                      const std::optional<WeatherOrigin>& origin,
                                      std::span<const WeatherPlane> planes, double every_s) {
  constexpr double kMostInstants = 1e7;
  const auto found = rows_of(file, origin);
  if (!found) return tl::unexpected<physics::Error>(found.error());
  if (!(every_s > 0.0) || !((found->to_s - found->from_s) / every_s < kMostInstants)) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               "the instants must be apart, and fewer than 10 million");
  }
  const scene::Place& at = found->origin.place;
  const physics::GeoPlace place{physics::Radians(at.lat_rad), physics::Radians(at.lon_rad),
                                physics::Metres(at.height_m)};
  PlaneCourse out;
  out.warnings = found->warnings;
  out.sums.resize(planes.size());
  const auto count = static_cast<std::size_t>((found->to_s - found->from_s) / every_s + 1e-9) + 1;
  out.instants.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    PlaneInstant row;
    row.time_s = found->from_s + every_s * static_cast<double>(i);
    const std::int64_t time_ns = std::llround(row.time_s * 1e9);
    const physics::SunPosition sun =
        physics::sun_position(found->origin.epoch_utc_ns + time_ns, place);
    const physics::Forcing weather = physics::forcing_from_rows(found->rows, time_ns);
    row.sun_azimuth_deg = sun.azimuth.value() / physics::kDegree;
    row.sun_elevation_deg = sun.elevation.value() / physics::kDegree;
    // The sun below the horizon counts as none, as in every simulation.
    row.direct_normal_w_m2 =
        row.sun_elevation_deg > 0.0 ? weather.direct_normal_w_m2 * (1.0 - weather.cloud_frac) : 0.0;
    row.diffuse_horizontal_w_m2 = weather.diffuse_horizontal_w_m2;
    row.longwave_down_w_m2 = weather.longwave_down_w_m2;
    row.air_k = weather.air_k;
    row.wind_m_s = weather.wind_m_s;
    row.rain_mm_h = physics::rain_rate_mm_h(found->rows, time_ns);
    const double weight = (i == 0 || i + 1 == count ? 0.5 : 1.0) * every_s / 3.6e6;
    for (std::size_t p = 0; p < planes.size(); ++p) {
      const glm::dvec3 normal = normal_of(planes[p]);
      const PlaneIrradiance on{
          row.direct_normal_w_m2 * std::max(0.0, glm::dot(normal, sun.direction_enu)),
          0.5 * (1.0 + normal.z) * row.diffuse_horizontal_w_m2};
      out.sums[p].beam_kwh_m2 += weight * on.beam_w_m2;
      out.sums[p].sky_kwh_m2 += weight * on.sky_w_m2;
      row.planes.push_back(on);
    }
    out.instants.push_back(std::move(row));
  }
  return out;
}

}  // namespace emit::config
