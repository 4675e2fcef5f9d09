// SPDX-License-Identifier: Apache-2.0
#include "emit/config/weather_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <set>

#include "emit/physics/clear_sky.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/sun.hpp"
#include "tables.hpp"
#include "weather_gaps.hpp"
#include "weather_year.hpp"

namespace emit::config {
namespace {

using physics::Result;

/// Sums one column.
class ColumnSum {
 public:
  void add(std::optional<double> value) {
    if (!value) {
      ++missing_;
      return;
    }
    least_ = std::min(least_, *value);
    most_ = std::max(most_, *value);
    sum_ += *value;
    ++count_;
  }
  [[nodiscard]] double mean() const {
    return count_ == 0 ? 0.0 : sum_ / static_cast<double>(count_);
  }
  /// Returns the column, or nothing if no record has it.
  void write(std::string name, std::string unit, std::vector<WeatherColumn>& out) const {
    if (count_ == 0) return;
    out.push_back({std::move(name), std::move(unit), missing_, least_, mean(), most_});
  }

 private:
  std::size_t missing_ = 0;
  std::size_t count_ = 0;
  double least_ = std::numeric_limits<double>::max();
  double most_ = std::numeric_limits<double>::lowest();
  double sum_ = 0.0;
};

struct YearColumn {
  const char* name;
  const char* unit;
  std::optional<double> YearRecord::*member;
};
constexpr YearColumn kYearColumns[] = {
    {"air", "K", &YearRecord::air_k},
    {"dew point", "K", &YearRecord::dew_point_k},
    {"wind", "m/s", &YearRecord::wind_m_s},
    {"wind from", "deg", &YearRecord::wind_from_deg},
    {"opaque sky cover", "", &YearRecord::cloud_frac},
    {"long-wave down", "W/m2", &YearRecord::longwave_down_w_m2},
    {"direct normal", "W/m2", &YearRecord::direct_normal_w_m2},
    {"diffuse horizontal", "W/m2", &YearRecord::diffuse_horizontal_w_m2},
    {"rain", "mm", &YearRecord::rain_mm}};

std::string text_of(const YearRecord& record) {
  const int minutes = static_cast<int>(std::lround(record.end_h * 60.0));
  return fmt::format("{}-{:02}-{:02} {:02}:{:02}", record.year, record.month, record.day,
                     minutes / 60, minutes % 60);
}

/// Returns the days since 1970 of the day of a record.
std::int64_t day_of(const YearRecord& record) {
  using namespace std::chrono;
  return sys_days(year(record.year) / record.month / record.day).time_since_epoch().count();
}

/// Collects the direct sun of records by the height of the sun.
class SunCheck {
 public:
  explicit SunCheck(const physics::GeoPlace& place) : place_(place) {}

  /// Adds a record with its beam over an interval.
  void add(std::int64_t begin_utc_ns, std::int64_t end_utc_ns, double beam_w_m2,
           WeatherReport& report) {
    constexpr std::int64_t kInstants = 12;
    constexpr double kSunRadiusRad = 0.2666 * physics::kDegree;
    // Take the interval's part with sun. Its middle stands for the height of the sun.
    std::optional<std::int64_t> first_ns;
    std::int64_t last_ns = 0;
    for (std::int64_t i = 0; i <= kInstants; ++i) {
      const std::int64_t at_ns = begin_utc_ns + (end_utc_ns - begin_utc_ns) / kInstants * i;
      if (physics::sun_position(at_ns, place_).elevation.value() < -kSunRadiusRad) continue;
      if (!first_ns) first_ns = at_ns;
      last_ns = at_ns;
    }
    if (!first_ns) {
      if (beam_w_m2 <= 0.0) return;
      ++report.beam_below_horizon;
      report.beam_below_horizon_kwh_m2 +=
          beam_w_m2 * static_cast<double>(end_utc_ns - begin_utc_ns) / 3.6e15;
      return;
    }
    constexpr double kVeryClearTurbidity = 2.0;
    const auto sun = physics::sun_position(*first_ns + (last_ns - *first_ns) / 2, place_);
    const double height_deg = sun.elevation.value() / physics::kDegree;
    Bin& bin = bins_[static_cast<std::size_t>(std::clamp(height_deg / kBinDeg, 0.0, kBins - 1.0))];
    bin.beams_w_m2.push_back(beam_w_m2);
    bin.clear_w_m2 +=
        physics::clear_sky_irradiance(sun, place_.height, kVeryClearTurbidity).direct_normal_w_m2;
  }
  void write(WeatherReport& report) {
    report.has_sun = true;
    for (std::size_t i = 0; i < bins_.size(); ++i) {
      Bin& bin = bins_[i];
      if (bin.beams_w_m2.empty()) continue;
      std::ranges::sort(bin.beams_w_m2);
      const std::size_t count = bin.beams_w_m2.size();
      report.sun_bins.push_back({kBinDeg * static_cast<double>(i), count,
                                 bin.beams_w_m2[(count - 1) / 2], bin.beams_w_m2.back(),
                                 bin.clear_w_m2 / static_cast<double>(count)});
    }
  }

 private:
  static constexpr double kBinDeg = 5.0;
  static constexpr double kBins = 18.0;
  struct Bin {
    std::vector<double> beams_w_m2;
    double clear_w_m2 = 0.0;
  };
  physics::GeoPlace place_;
  std::array<Bin, static_cast<std::size_t>(kBins)> bins_;
};

/// Sums of one month.
struct MonthSum {
  ColumnSum air;
  ColumnSum wind;
  ColumnSum beam;
  ColumnSum diffuse;
  ColumnSum longwave;
  std::array<ColumnSum, 24> hourly_beam;
  std::array<ColumnSum, 24> hourly_air;
};

void add_months(const WeatherYear& year, WeatherReport& report) {
  std::array<MonthSum, 12> sums;
  for (const YearRecord& record : year.records) {
    MonthSum& sum = sums[static_cast<std::size_t>(record.month - 1)];
    sum.air.add(record.air_k);
    sum.wind.add(record.wind_m_s);
    sum.beam.add(record.direct_normal_w_m2);
    sum.diffuse.add(record.diffuse_horizontal_w_m2);
    sum.longwave.add(record.longwave_down_w_m2);
    const auto hour = static_cast<std::size_t>(
        std::clamp(static_cast<int>(std::ceil(record.end_h - 1e-6)) - 1, 0, 23));
    sum.hourly_beam[hour].add(record.direct_normal_w_m2);
    sum.hourly_air[hour].add(record.air_k);
  }
  for (int m = 1; m <= 12; ++m) {
    const bool has = std::any_of(year.records.begin(), year.records.end(),
                                 [m](const YearRecord& record) { return record.month == m; });
    if (!has) continue;
    const MonthSum& sum = sums[static_cast<std::size_t>(m - 1)];
    WeatherMonth out;
    out.month = m;
    out.air_k = sum.air.mean();
    out.wind_m_s = sum.wind.mean();
    out.beam_kwh_m2_day = 0.024 * sum.beam.mean();
    out.diffuse_kwh_m2_day = 0.024 * sum.diffuse.mean();
    out.longwave_w_m2 = sum.longwave.mean();
    for (std::size_t h = 0; h < 24; ++h) {
      out.beam_w_m2[h] = sum.hourly_beam[h].mean();
      out.hourly_air_k[h] = sum.hourly_air[h].mean();
    }
    report.months.push_back(out);
  }
}

WeatherReport report_year(const WeatherYear& year, const std::string& name) {
  WeatherReport report;
  report.format = year.is_epw ? WeatherReport::Format::epw : WeatherReport::Format::tmy3;
  report.site = year.site;
  report.lat_deg = year.lat_deg;
  report.lon_deg = year.lon_deg;
  report.height_m = year.height_m;
  report.zone_h = year.zone_h;
  report.records = year.records.size();
  report.spacing_s = year.record_h * 3600.0;
  report.first = text_of(year.records.front());
  report.last = text_of(year.records.back());
  std::set<int> years;
  for (const YearRecord& record : year.records) years.insert(record.year);
  report.years.assign(years.begin(), years.end());
  for (const YearColumn& column : kYearColumns) {
    ColumnSum sum;
    for (const YearRecord& record : year.records) sum.add(record.*column.member);
    sum.write(column.name, column.unit, report.columns);
  }
  // A typical year takes its months from different years, so that only days count for gaps.
  const auto day_of_year = [](const YearRecord& record) {
    YearRecord same = record;
    same.year = 2000;
    return day_of(same);
  };
  // A year begins again after its end, so that its last record is followed by its first one.
  constexpr std::int64_t kDaysOf2000 = 366;
  std::set<std::int64_t> days_there;
  for (std::size_t i = 1; i <= year.records.size(); ++i) {
    const YearRecord& record = year.records[i % year.records.size()];
    const YearRecord& before = year.records[i - 1];
    days_there.insert(day_of_year(record));
    const std::int64_t days =
        (day_of_year(record) - day_of_year(before) + kDaysOf2000) % kDaysOf2000;
    const bool leap_day = record.month == 3 && record.day == 1 && days == 2;
    if (days > 1 && !leap_day) report.gaps.push_back({text_of(before), text_of(record)});
  }
  if (!report.gaps.empty()) {
    report.notes.push_back(
        fmt::format("{}: it has {} days of a year; a simulation on other days lacks weather, and "
                    "says so",
                    name, days_there.size()));
  }
  SunCheck check({physics::degrees(year.lat_deg), physics::degrees(year.lon_deg),
                  physics::Metres(year.height_m)});
  for (const YearRecord& record : year.records) {
    if (!record.direct_normal_w_m2) continue;
    constexpr double kNsPerHour = 3.6e12;
    const double day_h = 24.0 * static_cast<double>(day_of(record));
    const auto end_ns =
        static_cast<std::int64_t>(std::llround((day_h + record.end_h - year.zone_h) * kNsPerHour));
    check.add(end_ns - std::llround(year.record_h * kNsPerHour), end_ns, *record.direct_normal_w_m2,
              report);
  }
  check.write(report);
  add_months(year, report);
  // Take the sentences that a scenario at this place would give.
  scene::ScenarioDesc scenario;
  scenario.place = {year.lat_deg * physics::kDegree, year.lon_deg * physics::kDegree,
                    year.height_m};
  scenario.epoch_utc_ns = day_of(year.records.front()) * 86'400'000'000'000;
  static_cast<void>(weather_of_year(year, name, scenario, report.notes));
  return report;
}

struct TableColumn {
  const char* name;
  const char* unit;
  double scene::WeatherSample::*member;
};
constexpr TableColumn kTableColumns[] = {
    {"air", "K", &scene::WeatherSample::air_k},
    {"wind", "m/s", &scene::WeatherSample::wind_m_s},
    {"cloud share", "", &scene::WeatherSample::cloud_frac},
    {"long-wave down", "W/m2", &scene::WeatherSample::longwave_down_w_m2},
    {"direct normal", "W/m2", &scene::WeatherSample::direct_normal_w_m2},
    {"diffuse horizontal", "W/m2", &scene::WeatherSample::diffuse_horizontal_w_m2},
    {"rain", "mm/h", &scene::WeatherSample::rain_mm_h}};

/// Fills what depends on the height of the sun over a table.
void check_table_sun(const std::vector<scene::WeatherSample>& rows, const WeatherOrigin& origin,
                     WeatherReport& report) {
  SunCheck check({physics::Radians(origin.place.lat_rad), physics::Radians(origin.place.lon_rad),
                  physics::Metres(origin.place.height_m)});
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::int64_t at_ns = rows[i].sim_time_ns;
    const std::int64_t before_ns = i > 0 ? (at_ns - rows[i - 1].sim_time_ns) / 2 : 0;
    const std::int64_t after_ns = i + 1 < rows.size() ? (rows[i + 1].sim_time_ns - at_ns) / 2 : 0;
    const std::int64_t utc_ns = origin.epoch_utc_ns + at_ns;
    check.add(utc_ns - before_ns, utc_ns + after_ns,
              rows[i].direct_normal_w_m2 * (1.0 - rows[i].cloud_frac), report);
  }
  check.write(report);
}

/// Fills the rows for a plot.
void take_rows(const std::vector<scene::WeatherSample>& rows, WeatherReport& report) {
  constexpr std::size_t kMostRows = 2000;
  const std::size_t step = (rows.size() + kMostRows - 1) / kMostRows;
  for (std::size_t i = 0; i < rows.size(); i += step) {
    const scene::WeatherSample& row = rows[i];
    report.rows.push_back({static_cast<double>(row.sim_time_ns) / 1e9, row.air_k, row.wind_m_s,
                           row.direct_normal_w_m2, row.diffuse_horizontal_w_m2,
                           row.longwave_down_w_m2});
  }
}

WeatherReport report_table(const std::vector<scene::WeatherSample>& rows,
                           const std::optional<WeatherOrigin>& origin) {
  WeatherReport report;
  report.records = rows.size();
  if (rows.empty()) return report;
  const auto text = [](const scene::WeatherSample& row) {
    return fmt::format("{} s", static_cast<double>(row.sim_time_ns) / 1e9);
  };
  report.first = text(rows.front());
  report.last = text(rows.back());
  for (const TableColumn& column : kTableColumns) {
    ColumnSum sum;
    for (const scene::WeatherSample& row : rows) sum.add(row.*column.member);
    sum.write(column.name, column.unit, report.columns);
  }
  ColumnSum direction;
  ColumnSum environment;
  ColumnSum film;
  ColumnSum humidity;
  for (const scene::WeatherSample& row : rows) {
    direction.add(row.wind_from_rad ? std::optional(*row.wind_from_rad / physics::kDegree)
                                    : std::nullopt);
    environment.add(row.environment_k);
    film.add(row.film_w_m2_k);
    humidity.add(row.relative_humidity_frac);
  }
  direction.write("wind from", "deg", report.columns);
  environment.write("surroundings", "K", report.columns);
  film.write("film", "W/m2/K", report.columns);
  humidity.write("relative humidity", "", report.columns);
  if (rows.size() < 2) return report;
  if (origin) check_table_sun(rows, *origin, report);
  take_rows(rows, report);
  report.spacing_s = static_cast<double>(usual_spacing_ns(rows)) / 1e9;
  for (const std::size_t i : weather_gaps(rows, rows.front().sim_time_ns)) {
    report.gaps.push_back({text(rows[i - 1]), text(rows[i])});
  }
  return report;
}

}  // namespace

Result<WeatherReport> report_weather(const std::filesystem::path& file,
                                     const std::optional<WeatherOrigin>& origin) {
  WeatherReport report;
  if (is_weather_year(file)) {
    const auto year = load_weather_year(file);
    if (!year) return tl::unexpected<physics::Error>(year.error());
    report = report_year(*year, file.string());
  } else {
    const auto rows = load_weather_csv(file);
    if (!rows) return tl::unexpected<physics::Error>(rows.error());
    report = report_table(*rows, origin);
  }
  const bool has_direction =
      std::any_of(report.columns.begin(), report.columns.end(),
                  [](const WeatherColumn& column) { return column.name == "wind from"; });
  if (!has_direction) {
    report.notes.push_back(fmt::format(
        "{}: the wind has no direction, so that faces take the mean over all directions",
        file.string()));
  }
  return report;
}

}  // namespace emit::config
