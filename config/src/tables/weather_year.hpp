// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

/// Weather files of building simulation: EnergyPlus weather (EPW) and typical meteorological years
/// (TMY3).
namespace emit::config {

/// One record, which covers the time up to its instant. Values that the file marks as missing are
/// absent.
struct YearRecord {
  std::size_t line = 0;
  int year = 0;
  int month = 1;
  int day = 1;
  double end_h = 1.0;  ///< local standard time, above 0 to 24
  // These are values of the instant.
  std::optional<double> air_k;
  std::optional<double> dew_point_k;
  std::optional<double> wind_m_s;
  std::optional<double> wind_from_deg;       ///< clockwise from north
  std::optional<double> cloud_frac;          ///< opaque cover of the sky
  std::optional<double> longwave_down_w_m2;  ///< none: from air, dew point and cover
  // These are averages over the record.
  std::optional<double> direct_normal_w_m2;
  std::optional<double> diffuse_horizontal_w_m2;
  /// Depth of liquid water that fell over the record; none: not stated, so that none fell.
  std::optional<double> rain_mm;
  std::optional<double> rain_h;  ///< time over which it fell; none: the record
};

struct WeatherYear {
  bool is_epw = false;  ///< false: TMY3
  std::string site;
  double lat_deg = 0.0;
  double lon_deg = 0.0;
  double zone_h = 0.0;  ///< local standard time less UTC
  double height_m = 0.0;
  double record_h = 1.0;
  std::vector<YearRecord> records;  ///< whole days, each from its first to its last record
  std::size_t spread_rains = 0;     ///< records whose rain fell over more time than the record
};

/// Returns true for a file that begins as EPW or TMY3 do. A file that cannot be read is none.
[[nodiscard]] bool is_weather_year(const std::filesystem::path& file);

/// Reads the file. Errors: not_found; io; config, naming file, line and column.
[[nodiscard]] physics::Result<WeatherYear> load_weather_year(const std::filesystem::path& file);

/// Lays the days of the file around the scenario's epoch, by month and day, from 366 days before it
/// to 366 days after it. A leap day that the file lacks is the day before.
///
/// Rows come four to a record. Values of an instant are linear in between. Irradiances follow the
/// clear sky within a record and keep the record's average to 0.1 % or 0.1 W m-2; what would stand
/// below the horizon, or three times above a very clear sky, is left out. Clouds are in the
/// measured sun, so that `cloud_frac` is 0.
/// Warnings say what was filled, left out, or is of another place; `name` stands for the file.
[[nodiscard]] std::vector<scene::WeatherSample> weather_of_year(const WeatherYear& year,
                                                                const std::string& name,
                                                                const scene::ScenarioDesc& scenario,
                                                                std::vector<std::string>& warnings);

}  // namespace emit::config
