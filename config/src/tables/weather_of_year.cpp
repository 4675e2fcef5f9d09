// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <optional>
#include <span>

#include "emit/physics/clear_sky.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/physics/sun.hpp"
#include "weather_year.hpp"

namespace emit::config {

using physics::WeatherSample;

namespace {

constexpr double kHourNs = 3.6e12;
constexpr int kDaysAround = 366;
/// Rows to a record. Their trapezoid is what linear interpolation averages.
constexpr std::size_t kParts = 4;
constexpr double kWeights[kParts + 1] = {0.125, 0.25, 0.25, 0.25, 0.125};
/// A site this far from the scenario has another sun and another climate.
constexpr double kFarM = 50e3;
constexpr double kFarHeightM = 300.0;

/// A record on the axis of simulation time.
struct Interval {
  std::size_t record = 0;
  std::int64_t begin_ns = 0;
};

/// Counts of what the file does not say.
struct Filled {
  std::size_t values = 0;
  std::size_t longest = 0;       ///< records in the longest gap of one value
  std::size_t longest_line = 0;  ///< of the file, where it begins
  std::size_t longwave = 0;
  std::size_t longwave_guessed = 0;  ///< of these, without dew point or clouds anywhere
  std::size_t sun = 0;               ///< averages of sun and sky light, by day
  double left_out_w_h_m2 = 0.0;  ///< sun and sky light that the height of the sun does not allow
};

std::vector<Interval> lay_out(const WeatherYear& year, std::int64_t epoch_utc_ns) {
  using namespace std::chrono;
  const auto per_day = static_cast<std::size_t>(std::lround(24.0 / year.record_h));
  std::map<std::pair<int, int>, std::size_t> first_of_day;
  for (std::size_t i = 0; i < year.records.size(); i += per_day) {
    first_of_day[{year.records[i].month, year.records[i].day}] = i;
  }
  const auto zone_ns = std::llround(year.zone_h * kHourNs);
  const auto local =
      sys_time<std::chrono::nanoseconds>(std::chrono::nanoseconds(epoch_utc_ns + zone_ns));
  const auto today = floor<days>(local);
  std::vector<Interval> out;
  out.reserve(per_day * (2 * kDaysAround + 1));
  for (int i = -kDaysAround; i <= kDaysAround; ++i) {
    const sys_days begin = today + days(i);
    const year_month_day date(begin);
    std::pair<int, int> key{static_cast<int>(unsigned(date.month())),
                            static_cast<int>(unsigned(date.day()))};
    auto found = first_of_day.find(key);
    if (found == first_of_day.end() && key == std::pair(2, 29)) {
      found = first_of_day.find({2, 28});
    }
    if (found == first_of_day.end()) continue;
    const std::int64_t begin_ns =
        duration_cast<std::chrono::nanoseconds>(begin.time_since_epoch()).count() - zone_ns -
        epoch_utc_ns;
    for (std::size_t k = 0; k < per_day; ++k) {
      out.push_back({found->second + k,
                     begin_ns + std::llround(static_cast<double>(k) * year.record_h * kHourNs)});
    }
  }
  return out;
}

/// Replaces missing values of an instant by linear interpolation between those that are there.
void fill(std::vector<YearRecord>& records, std::optional<double> YearRecord::*member,
          Filled& filled) {
  std::optional<std::size_t> before;
  const auto close = [&](std::size_t end) {
    const std::size_t first = before ? *before + 1 : 0;
    filled.values += end - first;
    if (end - first <= filled.longest) return;
    filled.longest = end - first;
    filled.longest_line = records[first].line;
  };
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (!(records[i].*member)) continue;
    close(i);
    for (std::size_t k = before ? *before + 1 : 0; k < i; ++k) {
      const double share =
          before ? static_cast<double>(k - *before) / static_cast<double>(i - *before) : 1.0;
      const double from = before ? *(records[*before].*member) : *(records[i].*member);
      records[k].*member = from + share * (*(records[i].*member) - from);
    }
    before = i;
  }
  if (!before) return;
  close(records.size());
  for (std::size_t k = *before + 1; k < records.size(); ++k) {
    records[k].*member = records[*before].*member;
  }
}

void fill_longwave(std::vector<YearRecord>& records, const physics::CloudBase& base,
                   Filled& filled) {
  for (YearRecord& record : records) {
    if (record.longwave_down_w_m2) continue;
    // Air of unknown humidity is taken as half saturated: its dew point is 10 K below at 293 K.
    constexpr double kUsualDepressionK = 10.0;
    const double dew_k =
        std::clamp(record.dew_point_k.value_or(*record.air_k - kUsualDepressionK), 230.0, 310.0);
    record.longwave_down_w_m2 =
        physics::sky_longwave_w_m2(physics::Kelvin(*record.air_k), physics::Kelvin(dew_k),
                                   record.cloud_frac.value_or(0.0), base);
    ++filled.longwave;
    filled.longwave_guessed += record.dew_point_k && record.cloud_frac ? 0U : 1U;
  }
}

/// Replaces the factors of records that have sun but no average by linear interpolation between
/// those of other records with sun. Returns their number.
std::size_t fill_factors(const std::vector<bool>& has_sun, const std::vector<bool>& has_average,
                         std::vector<double>& factors) {
  std::vector<std::size_t> gap;
  std::size_t filled = 0;
  std::optional<double> before;
  const auto close = [&](std::optional<double> after) {
    for (std::size_t k = 0; k < gap.size(); ++k) {
      const double share = static_cast<double>(k + 1) / static_cast<double>(gap.size() + 1);
      const double from = before.value_or(after.value_or(0.0));
      factors[gap[k]] = std::lerp(from, after.value_or(from), share);
    }
    filled += gap.size();
    gap.clear();
  };
  for (std::size_t i = 0; i < factors.size(); ++i) {
    if (!has_sun[i]) continue;
    if (!has_average[i]) {
      gap.push_back(i);
      continue;
    }
    close(factors[i]);
    before = factors[i];
  }
  close(std::nullopt);
  return filled;
}

/// Spreads averages of records over rows: each row is the clear sky there times a factor, which is
/// linear between middles and ends of the records and found by iteration. Rows are kParts to a
/// record and one more.
/// @param averages  one to a record; none: missing, so that the factors of its neighbours count
/// @param clear     clear sky at the rows
/// @param record_h  length of a record
std::vector<double> spread(std::span<const std::optional<double>> averages,
                           std::span<const double> clear, double record_h, Filled& filled) {
  constexpr double kLargestFactor = 3.0;
  constexpr double kNight = 0.01;  // W m-2: the sun is below the horizon
  constexpr int kIterations = 40;
  const std::size_t count = averages.size();
  const auto average_of = [](const auto& value_at, std::size_t record) {
    double sum = 0.0;
    for (std::size_t j = 0; j <= kParts; ++j) sum += kWeights[j] * value_at(record * kParts + j);
    return sum;
  };
  std::vector<double> factors(count, 0.0);
  std::vector<bool> has_sun(count, false);
  std::vector<bool> has_average(count, false);
  std::vector<double> wanted(count, 0.0);
  for (std::size_t i = 0; i < count; ++i) {
    const double sky = average_of([&](std::size_t row) { return clear[row]; }, i);
    const double average = averages[i].value_or(0.0);
    has_sun[i] = sky > kNight;
    has_average[i] = averages[i].has_value();
    wanted[i] = has_sun[i] ? std::min(average, kLargestFactor * sky) : 0.0;
    filled.left_out_w_h_m2 += (average - wanted[i]) * record_h;
    if (has_sun[i]) factors[i] = wanted[i] / sky;
  }
  filled.sun += fill_factors(has_sun, has_average, factors);
  // Between two records the factor is their mean, which a record of little sun keeps low. Towards a
  // record without sun the factor stays as it is.
  const auto between = [&](std::size_t here, std::size_t next) {
    if (!has_sun[here]) return factors[next];
    if (!has_sun[next]) return factors[here];
    const double least = std::min(factors[here], factors[next]);
    return std::min(0.5 * (factors[here] + factors[next]), 2.0 * least);
  };
  const auto factor_at = [&](std::size_t row) {
    constexpr std::size_t kMiddle = kParts / 2;
    const std::size_t here = std::min(row / kParts, count - 1);
    const std::size_t part = row - here * kParts;
    const bool later = part >= kMiddle;
    const std::size_t next = later ? std::min(here + 1, count - 1) : (here == 0 ? 0 : here - 1);
    const double share = static_cast<double>(later ? part - kMiddle : kMiddle - part) / kMiddle;
    return std::lerp(factors[here], between(here, next), share);
  };
  const auto value_at = [&](std::size_t row) { return clear[row] * factor_at(row); };
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    for (std::size_t i = 0; i < count; ++i) {
      if (!has_sun[i] || !has_average[i] || wanted[i] == 0.0) continue;
      const double now = average_of(value_at, i);
      if (now > 0.0) factors[i] *= std::clamp(wanted[i] / now, 0.1, 10.0);
    }
  }
  std::vector<double> rows(clear.size());
  for (std::size_t row = 0; row < rows.size(); ++row) rows[row] = value_at(row);
  return rows;
}

/// Returns the direction of the wind between two records, on the shorter way around. A record
/// without direction takes that of the other one.
std::optional<double> wind_between(const YearRecord& from, const YearRecord& to, double share) {
  if (!from.wind_from_deg && !to.wind_from_deg) return std::nullopt;
  const double begin_deg = from.wind_from_deg.value_or(to.wind_from_deg.value_or(0.0));
  const double end_deg = to.wind_from_deg.value_or(begin_deg);
  const double turn_deg = std::remainder(end_deg - begin_deg, 360.0);
  const double deg = std::fmod(begin_deg + share * turn_deg + 360.0, 360.0);
  return deg * physics::kDegree;
}

/// Rows of a run of records that follow each other.
void append_rows(const WeatherYear& year, std::span<const Interval> run,
                 const scene::ScenarioDesc& scenario, Filled& filled,
                 std::vector<WeatherSample>& out) {
  const physics::GeoPlace place{physics::degrees(year.lat_deg), physics::degrees(year.lon_deg),
                                physics::Metres(year.height_m)};
  const double step_ns = year.record_h * kHourNs / kParts;
  const std::size_t rows = run.size() * kParts + 1;
  const auto time_ns = [&](std::size_t row) {
    const std::size_t record = std::min(row / kParts, run.size() - 1);
    return run[record].begin_ns +
           std::llround(static_cast<double>(row - record * kParts) * step_ns);
  };
  std::vector<double> beam(rows);
  std::vector<double> diffuse(rows);
  for (std::size_t row = 0; row < rows; ++row) {
    // A very clear sky is the shape of the beam; the sky's light follows the height of the sun.
    constexpr double kClearTurbidity = 2.0;
    constexpr double kBrightSkyW_m2 = 600.0;
    const auto sun = physics::sun_position(scenario.epoch_utc_ns + time_ns(row), place);
    beam[row] =
        physics::clear_sky_irradiance(sun, place.height, kClearTurbidity).direct_normal_w_m2;
    diffuse[row] = kBrightSkyW_m2 * std::max(0.0, sun.direction_enu.z);
  }
  std::vector<std::optional<double>> beams(run.size());
  std::vector<std::optional<double>> diffuses(run.size());
  for (std::size_t i = 0; i < run.size(); ++i) {
    beams[i] = year.records[run[i].record].direct_normal_w_m2;
    diffuses[i] = year.records[run[i].record].diffuse_horizontal_w_m2;
  }
  beam = spread(beams, beam, year.record_h, filled);
  diffuse = spread(diffuses, diffuse, year.record_h, filled);
  for (std::size_t row = 0; row < rows; ++row) {
    const std::size_t here = std::min(row / kParts, run.size() - 1);
    const double share = static_cast<double>(row - here * kParts) / static_cast<double>(kParts);
    const YearRecord& to = year.records[run[here].record];
    const YearRecord& from = year.records[run[here == 0 ? 0 : here - 1].record];
    const auto mix = [&](std::optional<double> YearRecord::*member) {
      return *(from.*member) + share * (*(to.*member) - *(from.*member));
    };
    WeatherSample sample;
    sample.sim_time_ns = time_ns(row);
    sample.direct_normal_w_m2 = beam[row];
    sample.diffuse_horizontal_w_m2 = diffuse[row];
    sample.longwave_down_w_m2 = mix(&YearRecord::longwave_down_w_m2);
    sample.air_k = mix(&YearRecord::air_k);
    sample.wind_m_s = mix(&YearRecord::wind_m_s);
    sample.wind_from_rad = wind_between(from, to, share);
    // A row holds the rain since the row before: the first row of a record that of the one before.
    const YearRecord& fell = share > 0.0 ? to : from;
    sample.rain_mm_h = row == 0 ? 0.0 : fell.rain_mm.value_or(0.0) / year.record_h;
    if (from.dew_point_k && to.dew_point_k) {
      // A dew point above the air comes from rounding: the air is saturated.
      sample.relative_humidity_frac =
          std::min(1.0, physics::saturation_over_water_pa(mix(&YearRecord::dew_point_k)) /
                            physics::saturation_over_water_pa(sample.air_k));
    }
    out.push_back(sample);
  }
}

void warn_of_place(const WeatherYear& year, const std::string& name,
                   const scene::ScenarioDesc& scenario, std::vector<std::string>& warnings) {
  constexpr double kEarthRadiusM = 6.371e6;
  const double lat = year.lat_deg * physics::kDegree;
  const double lon = year.lon_deg * physics::kDegree;
  const double cosine =
      std::sin(lat) * std::sin(scenario.place.lat_rad) +
      std::cos(lat) * std::cos(scenario.place.lat_rad) * std::cos(lon - scenario.place.lon_rad);
  const double away_m = kEarthRadiusM * std::acos(std::clamp(cosine, -1.0, 1.0));
  const double up_m = scenario.place.height_m - year.height_m;
  if (away_m < kFarM && std::abs(up_m) < kFarHeightM) return;
  warnings.push_back(fmt::format(
      "{}: the weather is of {} ({:.2f}, {:.2f}, {:.0f} m), which is {:.0f} km and {:.0f} m of "
      "height from the scenario's place",
      name, year.site, year.lat_deg, year.lon_deg, year.height_m, away_m / 1e3, std::abs(up_m)));
}

/// The days of one measured year are not those of another.
void warn_of_year(const WeatherYear& year, const std::string& name,
                  const scene::ScenarioDesc& scenario, std::vector<std::string>& warnings) {
  using namespace std::chrono;
  const int first = year.records.front().year;
  const bool is_typical = std::any_of(year.records.begin(), year.records.end(),
                                      [&](const YearRecord& r) { return r.year != first; });
  const auto epoch = floor<days>(
      sys_time<std::chrono::nanoseconds>(std::chrono::nanoseconds(scenario.epoch_utc_ns)));
  const int wanted = static_cast<int>(year_month_day(epoch).year());
  if (is_typical || first == wanted) return;
  warnings.push_back(
      fmt::format("{}: all days are of {}, and stand for those of {}", name, first, wanted));
}

}  // namespace

std::vector<WeatherSample> weather_of_year(const WeatherYear& given, const std::string& name,
                                           const scene::ScenarioDesc& scenario,
                                           std::vector<std::string>& warnings) {
  WeatherYear year = given;
  Filled filled;
  for (const auto member : {&YearRecord::air_k, &YearRecord::dew_point_k, &YearRecord::wind_m_s,
                            &YearRecord::cloud_frac}) {
    fill(year.records, member, filled);
  }
  fill_longwave(year.records, scenario.clear_sky.cloud_base, filled);
  const std::vector<Interval> intervals = lay_out(year, scenario.epoch_utc_ns);
  const auto record_ns = std::llround(year.record_h * kHourNs);
  std::vector<WeatherSample> out;
  out.reserve(intervals.size() * kParts + 1);
  for (std::size_t first = 0; first < intervals.size();) {
    std::size_t last = first + 1;
    while (last < intervals.size() &&
           intervals[last].begin_ns - intervals[last - 1].begin_ns <= record_ns) {
      ++last;
    }
    append_rows(year, std::span(intervals).subspan(first, last - first), scenario, filled, out);
    first = last;
  }
  warn_of_place(year, name, scenario, warnings);
  warn_of_year(year, name, scenario, warnings);
  if (year.spread_rains > 0) {
    warnings.push_back(fmt::format(
        "{}: {} records state rain of more than {:g} h; it is spread evenly over its time", name,
        year.spread_rains, year.record_h));
  }
  if (filled.values > 0) {
    warnings.push_back(fmt::format(
        "{}: {} missing values of air, dew point, wind or clouds are linear between others, the "
        "longest gap over {:g} h from line {} on",
        name, filled.values, static_cast<double>(filled.longest) * year.record_h,
        filled.longest_line));
  }
  if (filled.longwave > 0) {
    warnings.push_back(fmt::format(
        "{}: the long-wave irradiance of {} records is made of air, dew point and clouds{}", name,
        filled.longwave,
        filled.longwave_guessed == 0
            ? ""
            : ", with a dew point 10 K below the air, or without clouds, where the file has none"));
  }
  if (filled.sun > 0) {
    warnings.push_back(
        fmt::format("{}: {} missing averages of sun or sky light follow the records beside them",
                    name, filled.sun));
  }
  constexpr double kYearH = 8760.0;
  const double years = static_cast<double>(intervals.size()) * year.record_h / kYearH;
  const double per_year_w_h_m2 = filled.left_out_w_h_m2 / std::max(years, 1.0 / kYearH);
  constexpr double kWorthSayingW_h_m2 = 500.0;
  if (per_year_w_h_m2 > kWorthSayingW_h_m2) {
    warnings.push_back(fmt::format(
        "{}: {:.1f} kWh m-2 a year of sun and sky light are left out, because the sun is too low "
        "for them",
        name, per_year_w_h_m2 / 1e3));
  }
  return out;
}

}  // namespace emit::config
