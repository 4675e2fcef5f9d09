// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <iterator>
#include <span>
#include <string_view>

#include "emit/physics/constants.hpp"
#include "emit/physics/csv.hpp"
#include "emit/physics/limits.hpp"
#include "weather_year.hpp"

namespace emit::config {

using physics::Error;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

namespace {

constexpr std::string_view kEpwStart = "LOCATION,";
constexpr std::string_view kTmy3Column = "Date (MM/DD/YYYY)";

/// A value of the file: what it is called in messages, its factor and shift to the unit of the
/// record, the code from which on it is missing, and its range in the unit of the record.
struct Field {
  std::string_view name;
  std::optional<double> YearRecord::*member;
  double factor = 1.0;
  double shift = 0.0;
  double missing_from = 9999.0;
  physics::limits::Interval range;
  bool zero_is_missing = false;  ///< no sky sends nothing: such files hold 0 for a gap
};

using physics::kZeroCelsiusK;
const Field kAir{"dry bulb", &YearRecord::air_k, 1.0, kZeroCelsiusK, 99.9, physics::limits::kAirK};
const Field kDew{"dew point", &YearRecord::dew_point_k, 1.0, kZeroCelsiusK, 99.9, {150.0, 340.0}};
const Field kWind{"wind speed", &YearRecord::wind_m_s, 1.0, 0.0, 999.0, physics::limits::kWindMS};
const Field kDirection{"wind direction", &YearRecord::wind_from_deg, 1.0, 0.0, 999.0, {0.0, 360.0}};
const Field kCover{"opaque sky cover",         &YearRecord::cloud_frac, 0.1, 0.0, 99.0,
                   physics::limits::kCloudFrac};
const Field kLongwave{"horizontal infrared",
                      &YearRecord::longwave_down_w_m2,
                      1.0,
                      0.0,
                      9999.0,
                      physics::limits::kLongwaveDownWM2,
                      true};
const Field kBeam{"direct normal", &YearRecord::direct_normal_w_m2,  1.0, 0.0,
                  9999.0,          physics::limits::kDirectNormalWM2};
const Field kDiffuse{"diffuse horizontal",
                     &YearRecord::diffuse_horizontal_w_m2,
                     1.0,
                     0.0,
                     9999.0,
                     physics::limits::kDiffuseHorizontalWM2};
const Field kRain{"liquid precipitation depth", &YearRecord::rain_mm, 1.0, 0.0, 999.0,
                  physics::limits::kRainMmH};
const Field kRainHours{
    "liquid precipitation quantity", &YearRecord::rain_h, 1.0, 0.0, 99.0, {0.0, 98.0}};

/// Lines of a file with their numbers.
class Lines {
 public:
  Lines(const std::filesystem::path& file, std::string text)
      : name_(file.string()), text_(std::move(text)) {}
  /// Moves to the next line that is not blank; false at the end.
  bool next() {
    while (at_ < text_.size()) {
      const std::size_t end = std::min(text_.find('\n', at_), text_.size());
      line_ = std::string_view(text_).substr(at_, end - at_);
      if (line_.ends_with('\r')) line_.remove_suffix(1);
      at_ = end + 1;
      ++number_;
      if (line_.find_first_not_of(" \t,") != std::string_view::npos) return true;
    }
    return false;
  }
  [[nodiscard]] std::size_t number() const { return number_; }
  /// Cells between commas; quotes keep a comma.
  [[nodiscard]] std::vector<std::string_view> cells() const {
    std::vector<std::string_view> out;
    std::size_t begin = 0;
    bool quoted = false;
    for (std::size_t i = 0; i <= line_.size(); ++i) {
      if (i < line_.size() && line_[i] == '"') quoted = !quoted;
      if (i < line_.size() && (line_[i] != ',' || quoted)) continue;
      out.push_back(trimmed(line_.substr(begin, i - begin)));
      begin = i + 1;
    }
    return out;
  }
  [[nodiscard]] Error fault(const std::string& text) const {
    return {ErrorCode::config, fmt::format("{}:{}: {}", name_, number_, text)};
  }

 private:
  static std::string_view trimmed(std::string_view cell) {
    constexpr std::string_view kAround = " \t\"";
    const std::size_t first = cell.find_first_not_of(kAround);
    if (first == std::string_view::npos) return {};
    return cell.substr(first, cell.find_last_not_of(kAround) - first + 1);
  }
  std::string name_;
  std::string text_;
  std::string_view line_;
  std::size_t at_ = 0;
  std::size_t number_ = 0;
};

Result<double> number_of(const Lines& lines, std::span<const std::string_view> cells,
                         std::size_t column, std::string_view name) {
  if (column >= cells.size()) {
    return tl::unexpected(lines.fault(
        fmt::format("the line ends before '{}', which is column {}", name, column + 1)));
  }
  const auto value = physics::csv_number(cells[column]);
  if (!value || !std::isfinite(*value)) {
    return tl::unexpected(
        lines.fault(fmt::format("'{}' (column {}) holds '{}', {}", name, column + 1, cells[column],
                                physics::not_a_number_text(cells[column]))));
  }
  return *value;
}

/// Reads a value into the record. An empty cell and a code are missing values.
Result<void> take(const Lines& lines, std::span<const std::string_view> cells, std::size_t column,
                  const Field& field, YearRecord& record) {
  if (column < cells.size() && cells[column].empty()) return {};
  const auto value = number_of(lines, cells, column, field.name);
  if (!value) return tl::unexpected<Error>(value.error());
  // Negative codes are those of TMY3.
  if (*value >= field.missing_from || *value <= -9900.0) return {};
  if (field.zero_is_missing && *value == 0.0) return {};
  const double in_unit = *value * field.factor + field.shift;
  if (!field.range.contains(in_unit)) {
    return tl::unexpected(
        lines.fault(fmt::format("'{}' (column {}) holds {}, must be {:g} .. {:g}", field.name,
                                column + 1, *value, (field.range.lo - field.shift) / field.factor,
                                (field.range.hi - field.shift) / field.factor)));
  }
  record.*field.member = in_unit;
  return {};
}

Result<void> take_all(const Lines& lines, std::span<const std::string_view> cells,
                      std::span<const std::pair<std::size_t, const Field*>> columns,
                      YearRecord& record) {
  for (const auto& [column, field] : columns) {
    if (auto taken = take(lines, cells, column, *field, record); !taken) return taken;
  }
  return {};
}

/// Sets the date and checks it. The last record of a day ends at 24 h.
Result<void> set_date(const Lines& lines, std::array<int, 3> year_month_day, double end_h,
                      YearRecord& record) {
  using namespace std::chrono;
  record.line = lines.number();
  record.year = year_month_day[0];
  record.month = year_month_day[1];
  record.day = year_month_day[2];
  record.end_h = end_h;
  const month_day date{month(static_cast<unsigned>(record.month)),
                       day(static_cast<unsigned>(record.day))};
  if (record.month < 1 || record.day < 1 || !date.ok()) {
    return tl::unexpected(
        lines.fault(fmt::format("month {} and day {} are no date", record.month, record.day)));
  }
  if (!(end_h > 0.0 && end_h <= 24.0)) {
    return tl::unexpected(lines.fault(fmt::format("the record ends at {:g} h of its day", end_h)));
  }
  return {};
}

Result<void> read_site(const Lines& lines, std::span<const std::string_view> cells,
                       std::size_t first, bool zone_first, WeatherYear& year) {
  const std::size_t zone = zone_first ? first : first + 2;
  const std::size_t lat = zone_first ? first + 1 : first;
  const struct {
    std::size_t column;
    std::string_view name;
    double limit;
    double& out;
  } numbers[] = {{lat, "latitude", 90.0, year.lat_deg},
                 {lat + 1, "longitude", 180.0, year.lon_deg},
                 {zone, "time zone", 14.0, year.zone_h},
                 {first + 3, "elevation", 9000.0, year.height_m}};
  for (const auto& number : numbers) {
    const auto value = number_of(lines, cells, number.column, number.name);
    if (!value) return tl::unexpected<Error>(value.error());
    if (std::abs(*value) > number.limit) {
      return tl::unexpected(lines.fault(fmt::format(
          "'{}' is {:g}, must be {:g} .. {:g}", number.name, *value, -number.limit, number.limit)));
    }
    number.out = *value;
  }
  return {};
}

/// Reads the lines before the records of an EPW file.
Result<void> read_epw_head(Lines& lines, WeatherYear& year) {
  constexpr std::size_t kLatitude = 6;
  while (lines.next()) {
    const auto cells = lines.cells();
    if (cells[0] == "LOCATION") {
      year.site = cells.size() > 1 ? cells[1] : "";
      if (auto site = read_site(lines, cells, kLatitude, false, year); !site) return site;
    }
    if (cells[0] != "DATA PERIODS") continue;
    const auto per_hour = number_of(lines, cells, 2, "records per hour");
    if (!per_hour) return tl::unexpected<Error>(per_hour.error());
    if (!(*per_hour >= 1.0 && *per_hour <= 60.0 && std::fmod(60.0, *per_hour) == 0.0)) {
      return tl::unexpected(
          lines.fault(fmt::format("{:g} records per hour do not divide it", *per_hour)));
    }
    year.record_h = 1.0 / *per_hour;
    return {};
  }
  return tl::unexpected(lines.fault("the file has no line 'DATA PERIODS'"));
}

Result<WeatherYear> read_epw(Lines lines) {
  static const std::pair<std::size_t, const Field*> kColumns[] = {
      {6, &kAir},      {7, &kDew},        {12, &kLongwave}, {14, &kBeam},
      {15, &kDiffuse}, {20, &kDirection}, {21, &kWind},     {23, &kCover}};
  WeatherYear year;
  if (auto head = read_epw_head(lines, year); !head) return tl::unexpected<Error>(head.error());
  while (lines.next()) {
    const auto cells = lines.cells();
    std::array<double, 5> date{};  // year, month, day, hour, minute
    constexpr std::array<std::string_view, 5> kNames{"year", "month", "day", "hour", "minute"};
    for (std::size_t i = 0; i < date.size(); ++i) {
      const auto value = number_of(lines, cells, i, kNames[i]);
      if (!value) return tl::unexpected<Error>(value.error());
      if (std::abs(*value) > 9999.0) {
        return tl::unexpected(lines.fault(fmt::format("'{}' is {:g}", kNames[i], *value)));
      }
      date[i] = *value;
    }
    // Minute 0 and minute 60 both mean the end of the hour.
    const double minute = date[4] == 0.0 || year.record_h == 1.0 ? 60.0 : date[4];
    YearRecord record;
    auto read = set_date(
        lines, {static_cast<int>(date[0]), static_cast<int>(date[1]), static_cast<int>(date[2])},
        date[3] - 1.0 + minute / 60.0, record);
    if (read) read = take_all(lines, cells, kColumns, record);
    // Older files end before the rain.
    constexpr std::size_t kRainColumn = 33;
    if (read && cells.size() > kRainColumn) {
      read = take(lines, cells, kRainColumn, kRain, record);
    }
    if (read && cells.size() > kRainColumn + 1) {
      read = take(lines, cells, kRainColumn + 1, kRainHours, record);
    }
    if (!read) return tl::unexpected<Error>(read.error());
    year.records.push_back(record);
  }
  return year;
}

/// Reads "MM/DD/YYYY" and "HH:MM".
Result<void> read_tmy3_date(const Lines& lines, std::string_view date, std::string_view time,
                            YearRecord& record) {
  const auto digits = [](std::string_view text, std::size_t first, std::size_t count) {
    const auto value = physics::csv_number(text.substr(std::min(first, text.size()), count));
    return value && *value == std::floor(*value) && *value >= 0.0 ? static_cast<int>(*value) : -1;
  };
  const int hour = digits(time, 0, 2);
  const int minute = digits(time, 3, 2);
  if (date.size() != 10 || date[2] != '/' || date[5] != '/' || time.size() != 5 || time[2] != ':' ||
      hour < 0 || minute < 0) {
    return tl::unexpected(
        lines.fault(fmt::format("'{}' and '{}' must be MM/DD/YYYY and HH:MM", date, time)));
  }
  return set_date(lines, {digits(date, 6, 4), digits(date, 0, 2), digits(date, 3, 2)},
                  hour + minute / 60.0, record);
}

Result<WeatherYear> read_tmy3(Lines lines) {
  static constexpr std::pair<std::string_view, const Field*> kColumns[] = {
      {"DNI (W/m^2)", &kBeam},  {"DHI (W/m^2)", &kDiffuse}, {"Dry-bulb (C)", &kAir},
      {"Dew-point (C)", &kDew}, {"Wspd (m/s)", &kWind},     {"OpqCld (tenths)", &kCover}};
  WeatherYear year;
  lines.next();
  const auto site = lines.cells();
  year.site = site.size() > 1 ? site[1] : "";
  if (auto read = read_site(lines, site, 3, true, year); !read) {
    return tl::unexpected<Error>(read.error());
  }
  lines.next();
  const auto header = lines.cells();
  std::vector<std::pair<std::size_t, const Field*>> columns;
  // Faces can do without the direction of the wind, and rain is often not recorded.
  for (const auto& [name, field] :
       {std::pair<std::string_view, const Field*>{"Wdir (degrees)", &kDirection},
        {"Lprecip depth (mm)", &kRain},
        {"Lprecip quantity (hr)", &kRainHours}}) {
    const auto found = std::find(header.begin(), header.end(), name);
    if (found != header.end()) {
      columns.emplace_back(static_cast<std::size_t>(found - header.begin()), field);
    }
  }
  for (const auto& [name, field] : kColumns) {
    const auto found = std::find(header.begin(), header.end(), name);
    if (found == header.end()) {
      return tl::unexpected(lines.fault(fmt::format("column '{}' is missing", name)));
    }
    columns.emplace_back(static_cast<std::size_t>(found - header.begin()), field);
  }
  while (lines.next()) {
    const auto cells = lines.cells();
    YearRecord record;
    auto read = read_tmy3_date(lines, cells[0], cells.size() > 1 ? cells[1] : "", record);
    if (read) read = take_all(lines, cells, columns, record);
    if (!read) return tl::unexpected<Error>(read.error());
    year.records.push_back(record);
  }
  return year;
}

/// Spreads rain that fell over more than its record evenly over the records of its time. What these
/// state for themselves is part of it, as in sums over six hours beside hourly rain.
void spread_rain(WeatherYear& year) {
  for (std::size_t i = 0; i < year.records.size(); ++i) {
    YearRecord& last = year.records[i];
    if (!last.rain_h || !(last.rain_mm.value_or(0.0) > 0.0)) continue;
    const auto count =
        std::min(static_cast<std::size_t>(std::lround(*last.rain_h / year.record_h)), i + 1);
    if (count < 2) continue;
    ++year.spread_rains;
    const std::span<YearRecord> over(&year.records[i + 1 - count], count);
    double stated_mm = 0.0;
    for (const YearRecord& record : over.first(count - 1)) {
      stated_mm += record.rain_mm.value_or(0.0);
    }
    const double rest_mm = std::max(0.0, *last.rain_mm - stated_mm);
    last.rain_mm = 0.0;
    for (YearRecord& record : over) {
      record.rain_mm = record.rain_mm.value_or(0.0) + rest_mm / static_cast<double>(count);
    }
  }
}

/// Checks that every day is whole, and that the columns which nothing can replace hold something.
Result<void> check_year(const std::string& name, const WeatherYear& year) {
  const auto fault = [&](std::size_t line, const std::string& text) {
    return make_error(ErrorCode::config, fmt::format("{}:{}: {}", name, line, text));
  };
  if (year.records.empty()) return make_error(ErrorCode::config, name + ": no records");
  const auto per_day = static_cast<std::size_t>(std::lround(24.0 / year.record_h));
  for (std::size_t i = 0; i < year.records.size(); ++i) {
    const YearRecord& record = year.records[i];
    const double wanted_h = year.record_h * static_cast<double>(i % per_day + 1);
    const YearRecord& first = year.records[i - i % per_day];
    if (std::abs(record.end_h - wanted_h) > 0.01 || record.month != first.month ||
        record.day != first.day) {
      return fault(
          record.line,
          fmt::format("the record ends at {:g} h of {:02}-{:02}, where {:g} h of "
                      "{:02}-{:02} comes next",
                      record.end_h, record.month, record.day, wanted_h, first.month, first.day));
    }
  }
  if (year.records.size() % per_day != 0) {
    return fault(year.records.back().line, "the last day is not whole");
  }
  for (const Field* field : {&kAir, &kWind, &kBeam, &kDiffuse}) {
    const bool any = std::any_of(
        year.records.begin(), year.records.end(),
        [&](const YearRecord& record) { return (record.*(field->member)).has_value(); });
    if (!any) {
      return make_error(ErrorCode::config,
                        fmt::format("{}: every value of '{}' is missing", name, field->name));
    }
  }
  return {};
}

std::optional<std::string> text_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return std::nullopt;
  std::string text{std::istreambuf_iterator<char>(in), {}};
  if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);
  return text;
}

bool is_epw(std::string_view text) {
  return text.starts_with(kEpwStart);
}
bool is_tmy3(std::string_view text) {
  const std::size_t first = text.find('\n');
  return first != std::string_view::npos && text.substr(first + 1).starts_with(kTmy3Column);
}

}  // namespace

bool is_weather_year(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string start(4096, '\0');
  in.read(start.data(), static_cast<std::streamsize>(start.size()));
  start.resize(static_cast<std::size_t>(in.gcount()));
  if (start.starts_with("\xEF\xBB\xBF")) start.erase(0, 3);
  return is_epw(start) || is_tmy3(start);
}

Result<WeatherYear> load_weather_year(const std::filesystem::path& file) {
  auto text = text_of(file);
  if (!text) return make_error(ErrorCode::not_found, file.string() + ": cannot be read");
  const bool epw = is_epw(*text);
  auto year = epw ? read_epw({file, std::move(*text)}) : read_tmy3({file, std::move(*text)});
  if (!year) return year;
  year->is_epw = epw;
  if (auto checked = check_year(file.string(), *year); !checked) {
    return tl::unexpected<Error>(checked.error());
  }
  spread_rain(*year);
  return year;
}

}  // namespace emit::config
