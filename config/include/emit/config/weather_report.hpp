// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

/// Reports about weather files, for a reader. Setup only; any thread.
namespace emit::config {

/// Values of one column.
struct WeatherColumn {
  std::string name;
  std::string unit;
  std::size_t missing = 0;  ///< records without a value
  double least = 0.0;       ///< of the records that have one
  double mean = 0.0;
  double most = 0.0;
};

/// Means of a month over all of its records.
struct WeatherMonth {
  int month = 1;
  double air_k = 0.0;
  double wind_m_s = 0.0;
  double beam_kwh_m2_day = 0.0;  ///< direct sun on a face that looks at it
  double diffuse_kwh_m2_day = 0.0;
  double longwave_w_m2 = 0.0;  ///< 0 if the file has none
  /// Means by hour of the local day, of the hour that ends at index + 1.
  std::array<double, 24> beam_w_m2{};
  std::array<double, 24> hourly_air_k{};
};

/// Pause between records that is longer than the usual one.
struct WeatherGap {
  std::string from;  ///< date or seconds of simulation time
  std::string to;
};

/// Direct sun of the records over which the sun stands within 5 degrees of height.
struct WeatherSunBin {
  double from_deg = 0.0;     ///< lower end of the bin
  std::size_t records = 0;   ///< with a value
  double median_w_m2 = 0.0;  ///< direct normal
  double most_w_m2 = 0.0;
  double clear_w_m2 = 0.0;  ///< mean of a very clear sky (Linke turbidity 2) at those instants
};

/// Row of a CSV table.
struct WeatherRow {
  double time_s = 0.0;  ///< simulation time
  double air_k = 0.0;
  double wind_m_s = 0.0;
  double direct_normal_w_m2 = 0.0;
  double diffuse_horizontal_w_m2 = 0.0;
  double longwave_down_w_m2 = 0.0;
};

/// Contents of a weather file.
struct WeatherReport {
  enum class Format : std::uint8_t { epw, tmy3, csv };
  Format format = Format::csv;
  std::string site;  ///< empty for CSV, as are place, years and months
  std::optional<double> lat_deg;
  std::optional<double> lon_deg;
  double height_m = 0.0;
  double zone_h = 0.0;
  std::size_t records = 0;
  double spacing_s = 0.0;  ///< usual time between records
  std::string first;       ///< end of the first record, or its seconds of simulation time
  std::string last;
  std::vector<int> years;  ///< from which the days come, ascending
  std::vector<WeatherColumn> columns;
  std::vector<WeatherGap> gaps;
  /// Whether the place and time of the records are known, so that the height of the sun is.
  bool has_sun = false;
  /// Records with direct sun while the upper rim of the sun is below the horizon all the time: for
  /// CSV from half a row before to half a row after it. A simulation leaves that radiation out.
  std::size_t beam_below_horizon = 0;
  double beam_below_horizon_kwh_m2 = 0.0;
  std::vector<WeatherSunBin> sun_bins;  ///< ascending, those that have records
  std::vector<WeatherRow> rows;         ///< of CSV, at most about 2000 of them, evenly taken
  std::vector<WeatherMonth> months;     ///< those that the file has, ascending
  std::vector<std::string> notes;       ///< what a scenario fills or leaves out, one sentence each
};

/// Place and time of a table's simulation time 0, which CSV does not hold.
struct WeatherOrigin {
  scene::Place place;
  std::int64_t epoch_utc_ns = 0;
};

/// Reads a weather file of any format that `[weather] file` takes. `origin` gives the height of the
/// sun over a CSV table; EPW and TMY3 files have their own place and dates. Errors: those of the
/// readers, which name file, line and column.
[[nodiscard]] physics::Result<WeatherReport> report_weather(
    const std::filesystem::path& file, const std::optional<WeatherOrigin>& origin = {});

}  // namespace emit::config
