// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "emit/config/weather_report.hpp"

/// Sun and sky light on tilted planes over a weather file, as a simulation has them: for checks of
/// the import against other programs, such as the weather-driver cases of ASHRAE 140.
namespace emit::config {

struct WeatherPlane {
  double azimuth_deg = 0.0;  ///< of the normal, clockwise from north, 0..360
  double tilt_deg = 0.0;     ///< 0 level, 90 a wall, up to 180
};

/// Irradiance of a plane that sees no ground: nothing is reflected onto it.
struct PlaneIrradiance {
  double beam_w_m2 = 0.0;
  double sky_w_m2 = 0.0;  ///< of a sky that is the same all over: (1 + cos tilt)/2 of the diffuse
};
struct PlaneInstant {
  double time_s = 0.0;  ///< local standard time since 1 January 0 h; of CSV simulation time
  double sun_azimuth_deg = 0.0;  ///< clockwise from north
  double sun_elevation_deg = 0.0;
  double direct_normal_w_m2 = 0.0;  ///< after clouds
  double diffuse_horizontal_w_m2 = 0.0;
  double longwave_down_w_m2 = 0.0;
  double air_k = 0.0;
  double wind_m_s = 0.0;
  double rain_mm_h = 0.0;
  std::vector<PlaneIrradiance> planes;
};
/// Radiant exposure of a plane over all instants, by the trapezoidal rule.
struct PlaneSum {
  double beam_kwh_m2 = 0.0;
  double sky_kwh_m2 = 0.0;
};
struct PlaneCourse {
  std::vector<PlaneInstant> instants;
  std::vector<PlaneSum> sums;         ///< by plane
  std::vector<std::string> warnings;  ///< what was filled or left out, one sentence each
};

/// Computes what falls on planes at instants `every_s` apart: over the whole year of an EPW or TMY3
/// file, whose sun is that of the year of its first record, or of the next one without a leap day;
/// over the rows of a CSV table, whose place and time `origin` states.
/// Errors: those of the readers; invalid_argument (a table without origin, or more than 10 million
/// instants).
[[nodiscard]] physics::Result<PlaneCourse> weather_on_planes(
    const std::filesystem::path& file, const std::optional<WeatherOrigin>& origin,
    std::span<const WeatherPlane> planes, double every_s);

}  // namespace emit::config
