// SPDX-License-Identifier: Apache-2.0
#include "emit/config/weather_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <set>

#include "emit/physics/constants.hpp"
#include "emit/physics/sun.hpp"
#include "tables.hpp"
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
    {"diffuse horizontal", "W/m2", &YearRecord::diffuse_horizontal_w_m2}};

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

/// Returns whether the sun stands above the horizon at some time of a record.
bool sun_is_up(const YearRecord& record, const WeatherYear& file) {
  constexpr int kParts = 12;
  constexpr double kHourNs = 3.6e12;
  const physics::GeoPlace place{physics::degrees(file.lat_deg), physics::degrees(file.lon_deg),
                                physics::Metres(file.height_m)};
  const double day_h = 24.0 * static_cast<double>(day_of(record));
  for (int i = 0; i <= kParts; ++i) {
    const double end_h = record.end_h - file.record_h * i / kParts;
    const auto utc_ns =
        static_cast<std::int64_t>(std::llround((day_h + end_h - file.zone_h) * kHourNs));
    if (physics::sun_position(utc_ns, place).elevation.value() > 0.0) return true;
  }
  return false;
}

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

WeatherReport report_year(const WeatherYear& year, const std::string& name, bool is_epw) {
  WeatherReport report;
  report.format = is_epw ? WeatherReport::Format::epw : WeatherReport::Format::tmy3;
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
  for (std::size_t i = 1; i < year.records.size(); ++i) {
    const std::int64_t days = day_of_year(year.records[i]) - day_of_year(year.records[i - 1]);
    const bool leap_day = year.records[i].month == 3 && year.records[i].day == 1 && days == 2;
    if (days > 1 && !leap_day) {
      report.gaps.push_back({text_of(year.records[i - 1]), text_of(year.records[i])});
    }
  }
  for (const YearRecord& record : year.records) {
    const double beam_w_m2 = record.direct_normal_w_m2.value_or(0.0);
    if (beam_w_m2 <= 0.0 || sun_is_up(record, year)) continue;
    ++report.beam_below_horizon;
    report.beam_below_horizon_kwh_m2 += beam_w_m2 * year.record_h / 1e3;
  }
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
    {"diffuse horizontal", "W/m2", &scene::WeatherSample::diffuse_horizontal_w_m2}};

WeatherReport report_table(const std::vector<scene::WeatherSample>& rows) {
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
  for (const scene::WeatherSample& row : rows) {
    direction.add(row.wind_from_rad ? std::optional(*row.wind_from_rad / physics::kDegree)
                                    : std::nullopt);
    environment.add(row.environment_k);
    film.add(row.film_w_m2_k);
  }
  direction.write("wind from", "deg", report.columns);
  environment.write("surroundings", "K", report.columns);
  film.write("film", "W/m2/K", report.columns);
  if (rows.size() < 2) return report;
  // A pause much longer than the median is a gap.
  std::vector<std::int64_t> pauses_ns;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    pauses_ns.push_back(rows[i].sim_time_ns - rows[i - 1].sim_time_ns);
  }
  std::vector<std::int64_t> sorted_ns = pauses_ns;
  std::ranges::sort(sorted_ns);
  const double usual_ns = static_cast<double>(sorted_ns[(sorted_ns.size() - 1) / 2]);
  report.spacing_s = usual_ns / 1e9;
  constexpr double kGapRatio = 2.5;
  for (std::size_t i = 0; i < pauses_ns.size(); ++i) {
    if (static_cast<double>(pauses_ns[i]) > kGapRatio * usual_ns) {
      report.gaps.push_back({text(rows[i]), text(rows[i + 1])});
    }
  }
  return report;
}

}  // namespace

Result<WeatherReport> report_weather(const std::filesystem::path& file) {
  WeatherReport report;
  if (is_weather_year(file)) {
    const auto year = load_weather_year(file);
    if (!year) return tl::unexpected<physics::Error>(year.error());
    report = report_year(*year, file.string(), year->is_epw);
  } else {
    const auto rows = load_weather_csv(file);
    if (!rows) return tl::unexpected<physics::Error>(rows.error());
    report = report_table(*rows);
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
