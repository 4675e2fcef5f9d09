// SPDX-License-Identifier: Apache-2.0
#include "tool/logger/logger_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>
#include <regex>

#include "emit/physics/constants.hpp"
#include "emit/physics/csv.hpp"
#include "emit/physics/nearest_name.hpp"
#include "emit/physics/sun.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
/// Codes for a missing value that loggers write are far below every range.
constexpr double kMissingCode = -999.0;
constexpr double kZeroCelsiusK = 273.15;

enum class Quantity : std::uint8_t {
  time,
  ghi,
  dni,
  dhi,
  reflected,
  longwave_down,
  longwave_up,
  surface,
  air,
  wind,
  film,
  humidity,
  latent,
  count
};
constexpr std::size_t kQuantities = static_cast<std::size_t>(Quantity::count);

/// A column that a file may have: value in SI units = factor * cell + offset, within the range.
struct Column {
  const char* name;
  Quantity quantity;
  double factor;
  double offset;
  double low;
  double high;
};
constexpr Column kColumns[] = {
    {"time_s", Quantity::time, 1.0, 0.0, -4e9, 4e9},
    {"time_min", Quantity::time, 60.0, 0.0, -7e7, 7e7},
    {"time_h", Quantity::time, 3600.0, 0.0, -1.2e6, 1.2e6},
    {"ghi_w_m2", Quantity::ghi, 1.0, 0.0, -50.0, 2000.0},
    {"dni_w_m2", Quantity::dni, 1.0, 0.0, -50.0, 1500.0},
    {"dhi_w_m2", Quantity::dhi, 1.0, 0.0, -50.0, 1500.0},
    {"reflected_w_m2", Quantity::reflected, 1.0, 0.0, -50.0, 2000.0},
    {"longwave_down_w_m2", Quantity::longwave_down, 1.0, 0.0, 20.0, 800.0},
    {"longwave_up_w_m2", Quantity::longwave_up, 1.0, 0.0, 50.0, 1500.0},
    {"surface_k", Quantity::surface, 1.0, 0.0, 150.0, 450.0},
    {"surface_c", Quantity::surface, 1.0, kZeroCelsiusK, -123.15, 176.85},
    {"air_k", Quantity::air, 1.0, 0.0, 170.0, 340.0},
    {"air_c", Quantity::air, 1.0, kZeroCelsiusK, -103.15, 66.85},
    {"wind_m_s", Quantity::wind, 1.0, 0.0, 0.0, 100.0},
    {"film_w_m2_k", Quantity::film, 1.0, 0.0, 0.01, 1000.0},
    {"rh_pct", Quantity::humidity, 0.01, 0.0, 0.0, 110.0},
    {"latent_w_m2", Quantity::latent, 1.0, 0.0, -500.0, 1500.0},
};

/// Columns of a file by quantity.
struct Layout {
  struct Place {
    const Column* column = nullptr;
    std::size_t index = 0;
  };
  std::array<std::optional<Place>, kQuantities> places;

  [[nodiscard]] bool has(Quantity quantity) const {
    return places[static_cast<std::size_t>(quantity)].has_value();
  }
};

std::string column_names(Quantity quantity) {
  std::string out;
  for (const Column& column : kColumns) {
    if (column.quantity != quantity) continue;
    out += fmt::format("{}'{}'", out.empty() ? "" : " or ", column.name);
  }
  return out;
}

/// Returns the name that the file gives a column. Errors: a mapping names no column.
Result<std::vector<std::pair<std::string, std::string>>> mapping(const LoggerOptions& options) {
  std::vector<std::pair<std::string, std::string>> out;
  std::vector<std::string> known;
  for (const Column& column : kColumns) known.emplace_back(column.name);
  for (const std::string& text : options.columns) {
    const std::size_t at = text.find('=');
    const std::string name = text.substr(0, at);
    if (at == std::string::npos || at + 1 == text.size()) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("--column {}: must be COLUMN=NAME", text));
    }
    if (std::ranges::find(known, name) == known.end()) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("--column {}: there is no column '{}'{}", text, name,
                                    physics::did_you_mean(name, known)));
    }
    out.emplace_back(name, text.substr(at + 1));
  }
  return out;
}

Result<Layout> layout_of(const physics::CsvReader& reader, const LoggerOptions& options) {
  const auto names = mapping(options);
  if (!names) return tl::unexpected(names.error());
  Layout layout;
  for (const Column& column : kColumns) {
    std::string name = column.name;
    bool is_mapped = false;
    for (const auto& [known, theirs] : *names) {
      if (known != column.name) continue;
      name = theirs;
      is_mapped = true;
    }
    const auto is_here = [&](const physics::CsvCell& cell) { return cell.text == name; };
    if (!is_mapped && std::ranges::none_of(reader.header(), is_here)) continue;
    const auto index = reader.find(name);
    if (!index) return tl::unexpected(index.error());
    auto& place = layout.places[static_cast<std::size_t>(column.quantity)];
    if (place) {
      return make_error(
          ErrorCode::parse,
          fmt::format("{}:{}: columns '{}' and '{}' state the same quantity", reader.name(),
                      reader.line(), place->column->name, column.name));
    }
    place = Layout::Place{&column, *index};
  }
  if (layout.has(Quantity::surface) && layout.has(Quantity::longwave_up)) {
    // The thermometer's own reading counts.
    layout.places[static_cast<std::size_t>(Quantity::longwave_up)].reset();
  }
  const auto missing = [&](const std::string& what) {
    return make_error(ErrorCode::invalid_argument, fmt::format("{}:{}: there is no column {}",
                                                               reader.name(), reader.line(), what));
  };
  for (const Quantity needed : {Quantity::time, Quantity::longwave_down, Quantity::air}) {
    if (!layout.has(needed)) return missing(column_names(needed));
  }
  if (!layout.has(Quantity::ghi) && !(layout.has(Quantity::dni) && layout.has(Quantity::dhi))) {
    return missing("'ghi_w_m2', nor 'dni_w_m2' and 'dhi_w_m2'");
  }
  if (!layout.has(Quantity::wind) && !layout.has(Quantity::film)) {
    return missing("'wind_m_s' or 'film_w_m2_k'");
  }
  if (!layout.has(Quantity::surface) && !layout.has(Quantity::longwave_up)) {
    return missing("'longwave_up_w_m2', 'surface_k' or 'surface_c'");
  }
  return layout;
}

/// Reads the value of a cell in SI units, NaN for a missing one. Errors name file, line and column.
Result<double> value_of(const physics::CsvReader& reader, const Layout::Place& place) {
  const physics::CsvCell& cell = reader.row()[place.index];
  if (cell.text.empty()) return kMissing;
  const auto number = physics::csv_number(cell.text);
  if (!number) {
    return make_error(ErrorCode::parse,
                      fmt::format("{}: {}: {}", reader.place_of(cell), place.column->name,
                                  physics::not_a_number_text(cell.text)));
  }
  const bool is_time = place.column->quantity == Quantity::time;
  if (std::isnan(*number) || (!is_time && *number <= kMissingCode)) return kMissing;
  if (*number < place.column->low || *number > place.column->high) {
    return make_error(
        ErrorCode::parse,
        fmt::format("{}: {} is {}, must be {:g} .. {:g}", reader.place_of(cell), place.column->name,
                    cell.text, place.column->low, place.column->high));
  }
  return *number * place.column->factor + place.column->offset;
}

double number_of(const std::ssub_match& match) {
  double value = 0.0;
  std::from_chars(&*match.first, &*match.first + match.length(), value);
  return value;
}

/// Returns the instant of 00:00 UTC of a date, POSIX ns, or nothing for other text.
std::optional<std::int64_t> read_date(const std::string& text) {
  static const std::regex form(R"((\d{4})-(\d{2})-(\d{2}))");
  std::smatch found;
  if (!std::regex_match(text, found, form)) return std::nullopt;
  const std::chrono::year_month_day day{
      std::chrono::year(static_cast<int>(number_of(found[1]))),
      std::chrono::month(static_cast<unsigned>(number_of(found[2]))),
      std::chrono::day(static_cast<unsigned>(number_of(found[3])))};
  if (!day.ok()) return std::nullopt;
  return std::chrono::nanoseconds(std::chrono::sys_days(day).time_since_epoch()).count();
}

/// Reads place and date from text such as "37.70 N, 105.92 W, 2317 m; UTC of 2016-01-01".
void read_words(LoggerRecord& record) {
  static const std::regex place(
      R"((\d+(?:\.\d+)?)\s*([NS])\s*,\s*(\d+(?:\.\d+)?)\s*([EW])\s*,\s*(-?\d+(?:\.\d+)?)\s*m\b)");
  static const std::regex date(R"(UTC of (\d{4}-\d{2}-\d{2}))");
  std::smatch found;
  if (std::regex_search(record.words, found, place)) {
    record.lat_deg = number_of(found[1]) * (found[2] == "S" ? -1.0 : 1.0);
    record.lon_deg = number_of(found[3]) * (found[4] == "W" ? -1.0 : 1.0);
    record.height_m = number_of(found[5]);
    record.notes.push_back(fmt::format("a comment line states the place: {} {}, {} {}, {} m",
                                       found[1].str(), found[2].str(), found[3].str(),
                                       found[4].str(), found[5].str()));
  }
  if (std::regex_search(record.words, found, date)) {
    record.epoch_utc_ns = read_date(found[1].str());
    record.notes.push_back(fmt::format("a comment line states the date: {}", found[1].str()));
  }
}

Result<void> read_origin(const LoggerOptions& options, LoggerRecord& record) {
  std::ifstream in(record.file);
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with('#')) record.words += line + "\n";
  }
  record.words += options.surface;
  read_words(record);
  if (options.lat_deg) record.lat_deg = options.lat_deg;
  if (options.lon_deg) record.lon_deg = options.lon_deg;
  if (options.height_m) record.height_m = options.height_m;
  if (options.date.empty()) return {};
  record.epoch_utc_ns = read_date(options.date);
  if (record.epoch_utc_ns) return {};
  return make_error(ErrorCode::invalid_argument,
                    fmt::format("--date {}: must be a date as 2016-01-31", options.date));
}

/// Sine of the sun's height; not below 0.
double sun_sine(const LoggerRecord& record, double time_s) {
  const physics::GeoPlace place = place_of(record);
  const auto at_ns = *record.epoch_utc_ns + static_cast<std::int64_t>(time_s * 1e9);
  return std::max(0.0, physics::sun_position(at_ns, place).direction_enu.z);
}

/// Sums over the rows, for notes and the reflected share.
struct Sums {
  double incident = 0.0;
  double reflected = 0.0;
  double sun = 0.0;         // where its place in the sky is known
  double dark_sun = 0.0;    // of that, below the horizon
  double global_sun = 0.0;  // where direct, diffuse and global are known
  double sun_gap = 0.0;
  std::size_t beam_rows = 0;
  std::size_t global_rows = 0;
  std::size_t left_out = 0;
  std::size_t first_left_out = 0;
  std::size_t negative_sun = 0;
  double least_sun = 0.0;
};

void add_notes(const Sums& sums, LoggerRecord& record) {
  record.notes.push_back(
      sums.global_rows == 0 ? std::string("sun: direct and diffuse, added")
      : sums.beam_rows == 0
          ? std::string("sun: global")
          : fmt::format("sun: direct and diffuse, added; global in {} rows", sums.global_rows));
  if (sums.left_out > 0) {
    record.notes.push_back(
        fmt::format("{} rows lack a value and are left out, the first in line {}", sums.left_out,
                    sums.first_left_out));
  }
  if (sums.negative_sun > 0) {
    record.notes.push_back(fmt::format("sun below 0 in {} rows, {:.1f} W/m2 at least: taken as 0",
                                       sums.negative_sun, sums.least_sun));
  }
  if (sums.reflected > 0.0 && sums.incident > 0.0) {
    record.reflected_frac = sums.reflected / sums.incident;
  }
  if (sums.sun > 0.0) record.dark_sun_frac = sums.dark_sun / sums.sun;
  if (sums.global_sun > 0.0) record.sun_gap_frac = sums.sun_gap / sums.global_sun;
  constexpr double kGapS = 1800.0;
  for (std::size_t i = 1; i < record.rows.size(); ++i) {
    const double pause_s = record.rows[i].time_s - record.rows[i - 1].time_s;
    if (pause_s <= kGapS) continue;
    record.notes.push_back(fmt::format("nothing for {:.1f} h from {:.0f} s on: taken as linear",
                                       pause_s / 3600.0, record.rows[i - 1].time_s));
  }
}

}  // namespace

physics::GeoPlace place_of(const LoggerRecord& record) noexcept {
  constexpr double kRadPerDeg = std::numbers::pi / 180.0;
  return {physics::Radians(record.lat_deg.value_or(0.0) * kRadPerDeg),
          physics::Radians(record.lon_deg.value_or(0.0) * kRadPerDeg),
          physics::Metres(record.height_m.value_or(0.0))};
}

Result<LoggerRecord> read_logger(const std::filesystem::path& file, const LoggerOptions& options) {
  auto reader = physics::CsvReader::open(file);
  if (!reader) return tl::unexpected(std::move(reader.error()));
  const auto layout = layout_of(*reader, options);
  if (!layout) return tl::unexpected(layout.error());
  LoggerRecord record;
  record.file = file;
  if (auto done = read_origin(options, record); !done) return tl::unexpected(done.error());
  const bool has_beam = layout->has(Quantity::dni) && layout->has(Quantity::dhi);
  const bool has_global = layout->has(Quantity::ghi);
  const bool has_origin = record.lat_deg && record.lon_deg && record.epoch_utc_ns;
  if (!has_global && !has_origin) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{}: 'dni_w_m2' without 'ghi_w_m2' needs a place and a date: "
                                  "--lat-deg, --lon-deg, --date",
                                  file.string()));
  }
  Sums sums;
  while (true) {
    const auto more = reader->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    std::array<double, kQuantities> values;
    values.fill(kMissing);
    bool is_whole = true;
    for (std::size_t q = 0; q < kQuantities; ++q) {
      if (!layout->places[q]) continue;
      const auto value = value_of(*reader, *layout->places[q]);
      if (!value) return tl::unexpected(value.error());
      values[q] = *value;
      const auto quantity = static_cast<Quantity>(q);
      const bool spare = quantity == Quantity::humidity || quantity == Quantity::latent ||
                         quantity == Quantity::reflected || quantity == Quantity::ghi ||
                         quantity == Quantity::dni || quantity == Quantity::dhi;
      is_whole = is_whole && (spare || !std::isnan(*value));
    }
    const auto at = [&](Quantity q) { return values[static_cast<std::size_t>(q)]; };
    const double time_s = at(Quantity::time);
    const double sine = has_origin && !std::isnan(time_s) ? sun_sine(record, time_s) : kMissing;
    const double beam_sun = has_beam ? at(Quantity::dni) * sine + at(Quantity::dhi) : kMissing;
    const double sun = std::isnan(beam_sun) ? at(Quantity::ghi) : beam_sun;
    if (!is_whole || std::isnan(sun)) {
      if (sums.left_out++ == 0) sums.first_left_out = reader->line();
      continue;
    }
    if (!record.rows.empty() && time_s <= record.rows.back().time_s) {
      return make_error(ErrorCode::parse,
                        fmt::format("{}:{}: time {} s does not come after {} s", file.string(),
                                    reader->line(), time_s, record.rows.back().time_s));
    }
    if (!std::isnan(sine)) {
      // Direct sun counts across its beam, so that its share does not vanish with the sine.
      const double any_sun = std::max(
          {0.0, sun,
           has_beam && !std::isnan(beam_sun) ? at(Quantity::dni) + at(Quantity::dhi) : 0.0});
      sums.sun += any_sun;
      if (sine <= 0.0) sums.dark_sun += any_sun;
    }
    if (const double global = at(Quantity::ghi); !std::isnan(beam_sun) && !std::isnan(global)) {
      sums.global_sun += std::max(0.0, global);
      sums.sun_gap += std::abs(beam_sun - global);
    }
    ++(std::isnan(beam_sun) ? sums.global_rows : sums.beam_rows);
    if (sun < 0.0) {
      ++sums.negative_sun;
      sums.least_sun = std::min(sums.least_sun, sun);
    }
    reference::LoggerRow row;
    row.time_s = time_s;
    row.sun_w_m2 = std::max(0.0, sun);
    row.longwave_down_w_m2 = at(Quantity::longwave_down);
    row.air_k = at(Quantity::air);
    row.wind_m_s = layout->has(Quantity::wind) ? at(Quantity::wind) : 0.0;
    row.film_w_m2_k = layout->has(Quantity::film) ? at(Quantity::film) : 0.0;
    row.surface_k = at(Quantity::surface);
    record.rows.push_back(row);
    if (layout->has(Quantity::longwave_up)) {
      record.longwave_up_w_m2.push_back(at(Quantity::longwave_up));
    }
    if (layout->has(Quantity::humidity)) record.rh_frac.push_back(at(Quantity::humidity));
    if (layout->has(Quantity::latent)) record.latent_w_m2.push_back(at(Quantity::latent));
    if (std::isnan(at(Quantity::reflected))) continue;
    sums.incident += row.sun_w_m2;
    sums.reflected += std::max(0.0, at(Quantity::reflected));
  }
  add_notes(sums, record);
  return record;
}

void set_emissivity(LoggerRecord& record, double emissivity_frac) {
  for (std::size_t i = 0; i < record.longwave_up_w_m2.size(); ++i) {
    const double emitted_w_m2 =
        record.longwave_up_w_m2[i] - (1.0 - emissivity_frac) * record.rows[i].longwave_down_w_m2;
    record.rows[i].surface_k = std::pow(
        std::max(0.0, emitted_w_m2) / (emissivity_frac * physics::kStefanBoltzmannWPerM2K4), 0.25);
  }
}

}  // namespace emit::tool
