// SPDX-License-Identifier: Apache-2.0
#include "tape7.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <fstream>
#include <string>
#include <string_view>
#include <utility>

#include "emit/physics/air_model.hpp"
#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"

namespace emit::config {
namespace {

namespace fs = std::filesystem;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr double kWM2PerWCm2 = 1e4;
constexpr double kUmPerCm = 1e4;

/// A column: its name and its last place. It begins behind the column before it.
struct Column {
  std::string name;
  std::size_t end = 0;
};

std::string_view without_blanks(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// Names that MODTRAN 4 writes with a blank where later versions write an underscore.
constexpr std::array<std::string_view, 10> kSplitNames{
    "TOT TRANS", "PTH THRML", "THRML SCT", "SURF EMIS", "SOL SCAT",
    "SING SCAT", "GRND RFLT", "DRCT RFLT", "TOTAL RAD", "SOL TR"};

/// Returns the columns of a line of names. Names are flush right with their numbers.
std::vector<Column> columns_of(std::string line) {
  for (const std::string_view name : kSplitNames) {
    const std::size_t at = line.find(name);
    if (at != std::string::npos) line[at + name.find(' ')] = '_';
  }
  std::vector<Column> columns;
  for (std::size_t at = line.find_first_not_of(" \r"); at != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(" \r", at), line.size());
    columns.push_back({line.substr(at, end - at), end});
    at = line.find_first_not_of(" \r", end);
  }
  return columns;
}

/// Number of a field as Fortran prints it: an exponent of three digits has no E, and one of double
/// precision has a D.
std::optional<double> fortran_number(std::string_view field) {
  std::string text(field.starts_with('+') ? field.substr(1) : field);
  if (const std::size_t d = text.find_first_of("Dd"); d != std::string::npos) text[d] = 'E';
  const std::size_t sign = text.find_last_of("+-");
  if (sign != std::string::npos && sign > 0 &&
      std::isdigit(static_cast<unsigned char>(text[sign - 1])) != 0) {
    text.insert(sign, "E");
  }
  double value = 0.0;
  const char* end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, value);
  if (read.ec != std::errc() || read.ptr != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// Field of a line between two places. Blank fields and lines that end before it are empty.
std::string_view field_of(std::string_view line, std::size_t begin, std::size_t end) {
  return begin < line.size() ? without_blanks(line.substr(begin, end - begin)) : std::string_view{};
}

bool names_columns(std::string_view line) {
  const std::string_view text = without_blanks(line);
  return text.starts_with("FREQ ") || text.starts_with("WAVLEN");
}

/// Returns the model atmosphere that a card names; its words may have any number of blanks between
/// them.
std::optional<physics::AirColumn> model_atmosphere(std::string_view line) {
  constexpr std::array<std::pair<std::string_view, physics::AirClimate>, 6> kNames{
      {{"TROPICALMODEL", physics::AirClimate::tropical},
       {"MIDLATITUDESUMMER", physics::AirClimate::midlatitude_summer},
       {"MIDLATITUDEWINTER", physics::AirClimate::midlatitude_winter},
       {"SUBARCTICSUMMER", physics::AirClimate::subarctic_summer},
       {"SUBARCTICWINTER", physics::AirClimate::subarctic_winter},
       {"USSTANDARD", physics::AirClimate::us_standard}}};
  std::string letters;
  for (const char c : line) {
    if (std::isalpha(static_cast<unsigned char>(c)) != 0) letters += c;
  }
  for (const auto& [name, climate] : kNames) {
    if (letters != name) continue;
    physics::AirSpec spec;
    spec.climate = climate;
    if (auto column = physics::AirColumn::build(spec)) return std::move(*column);
  }
  return std::nullopt;
}

/// Reads the path of a run from its cards. Its line has six fields: H1, H2, zenith angle, range,
/// angle at the earth's centre, and the earth's radius, by which the line is known.
bool read_path(std::string_view line, Tape7Run& run) {
  constexpr std::array<std::size_t, 7> kPlaces{0, 10, 20, 30, 40, 50, 62};
  constexpr double kTopKm = 99.0;  // the air of MODTRAN ends at 100 km
  std::array<double, 6> value{};
  for (std::size_t i = 0; i < value.size(); ++i) {
    const auto number = fortran_number(field_of(line, kPlaces[i], kPlaces[i + 1]));
    if (!number) return false;
    value[i] = *number;
  }
  if (!(value[5] > 6000.0 && value[5] < 7000.0) || !(value[3] > 0.0)) return false;
  run.sensor_m = value[0] * 1e3;
  run.elevation_deg = 90.0 - value[2];
  run.range_m = value[3] * 1e3;
  run.leaves_air = value[1] >= kTopKm;
  return true;
}

/// Tape7Reader of one file, line by line.
class Tape7Reader {
 public:
  explicit Tape7Reader(const fs::path& file) : file_(file), in_(file, std::ios::binary) {}
  Result<std::vector<Tape7Run>> read();

 private:
  bool next() {
    if (!std::getline(in_, line_)) return false;
    ++number_;
    return true;
  }
  [[nodiscard]] tl::unexpected<physics::Error> fault(const std::string& text) const {
    return make_error(ErrorCode::config, fmt::format("{}:{}: {}", file_.string(), number_, text));
  }
  /// Reads the number of a column of the current line.
  Result<double> number(const std::vector<Column>& columns, std::size_t column) const;
  Result<void> read_samples(const std::vector<Column>& columns, Tape7Run& run);
  fs::path file_;
  std::ifstream in_;
  std::string line_;
  std::uint32_t number_ = 0;
};

std::size_t column_place(const std::vector<Column>& columns,
                         std::initializer_list<std::string_view> names) {
  for (const std::string_view name : names) {
    for (std::size_t i = 0; i < columns.size(); ++i) {
      if (columns[i].name == name) return i;
    }
  }
  return columns.size();
}

Result<std::vector<Tape7Run>> Tape7Reader::read() {
  if (!in_) {
    return make_error(fs::exists(file_) ? ErrorCode::io : ErrorCode::not_found,
                      fmt::format("{}: cannot be read", file_.string()));
  }
  std::vector<Tape7Run> runs;
  Tape7Run run;
  std::optional<physics::AirColumn> column;  // of the model atmosphere that the cards name
  bool has_path = false;
  std::uint32_t irradiance_line = 0;
  while (next()) {
    if (!names_columns(line_)) {
      if (auto named = model_atmosphere(line_)) column = std::move(named);
      has_path = read_path(line_, run) || has_path;
      continue;
    }
    run.line = number_;
    if (without_blanks(line_).starts_with("WAVLEN")) {
      return fault("the columns are over wavelengths: ask MODTRAN for wavenumbers (FREQ)");
    }
    const std::vector<Column> columns = columns_of(line_);
    if (column_place(columns, {"SOLAR"}) < columns.size()) {
      irradiance_line = number_;
      while (next() && !without_blanks(line_).starts_with("-9999")) {
      }
    } else {
      if (!has_path) return fault("no line of the cards before this one gives H1, angle and range");
      if (column && run.elevation_deg == 0.0 && !run.leaves_air) {
        run.level_k = column->at(run.sensor_m).kelvin;
      }
      if (auto read = read_samples(columns, run); !read) return tl::unexpected(read.error());
      runs.push_back(std::move(run));
    }
    run = {};
    column.reset();
    has_path = false;
  }
  if (runs.empty() && irradiance_line > 0) {
    number_ = irradiance_line;
    return fault("all runs are of direct solar irradiance (IEMSCT 3), which has no path radiance");
  }
  if (runs.empty()) return fault("there is no run: no line names columns from FREQ on");
  return runs;
}

Result<double> Tape7Reader::number(const std::vector<Column>& columns, std::size_t column) const {
  const std::size_t begin = column == 0 ? 0 : columns[column - 1].end;
  const std::size_t end = columns[column].end;
  const std::string_view field = field_of(line_, begin, end);
  const std::string& name = columns[column].name;
  if (field.empty()) return fault(fmt::format("the field of column {} is blank", name));
  const auto value = fortran_number(field);
  if (!value) return fault(fmt::format("'{}' in column {} is not a number", field, name));
  // Numbers are flush right. What ends before its place belongs to a line that has been moved.
  if (line_.size() < end || line_[end - 1] == ' ') {
    return fault(fmt::format("'{}' in column {} does not end at place {}, where its name ends",
                             field, name, end));
  }
  return *value;
}

Result<void> Tape7Reader::read_samples(const std::vector<Column>& columns, Tape7Run& run) {
  const std::size_t tau = column_place(columns, {"TOT_TRANS", "COMBIN", "TOTAL", "TRANS"});
  if (tau == columns.size()) return fault("there is no column TOT_TRANS, COMBIN, TOTAL or TRANS");
  const std::size_t total = column_place(columns, {"TOTAL_RAD"});
  run.has_radiance = total < columns.size();
  std::vector<std::size_t> of_surface;
  for (const std::string_view name : {"SURF_EMIS", "GRND_RFLT"}) {
    const std::size_t column = column_place(columns, {name});
    if (run.has_radiance && column < columns.size()) of_surface.push_back(column);
  }
  bool ended = false;
  while (!ended && next()) {
    const std::string_view text = without_blanks(line_);
    ended = text.starts_with("-9999");
    if (ended || text.empty() || text.starts_with("CM-1")) continue;
    if (names_columns(line_)) {
      return fault("a run begins before the -9999 that ends the one before");
    }
    const auto wavenumber = number(columns, 0);
    if (!wavenumber) return tl::unexpected(wavenumber.error());
    const auto transmittance = number(columns, tau);
    if (!transmittance) return tl::unexpected(transmittance.error());
    double radiance = 0.0;
    if (run.has_radiance) {
      const auto all = number(columns, total);
      if (!all) return tl::unexpected(all.error());
      radiance = *all;
    }
    for (const std::size_t column : of_surface) {
      if (field_of(line_, columns[column - 1].end, columns[column].end).empty()) continue;
      const auto part = number(columns, column);
      if (!part) return tl::unexpected(part.error());
      radiance -= *part;
    }
    if (!(*transmittance >= 0.0 && *transmittance <= 1.0)) {
      return fault(fmt::format("the transmittance is {}, must be 0 .. 1", *transmittance));
    }
    const double before = run.samples.empty() ? 0.0 : run.samples.back().wavenumber_per_cm;
    if (!(*wavenumber > before)) {
      return fault(fmt::format("the wavenumber {} is not above {}, that of the line before",
                               *wavenumber, before));
    }
    // The rounding of both can leave less than nothing where the surface is most of the total.
    run.samples.push_back({*wavenumber, *transmittance, std::max(0.0, radiance * kWM2PerWCm2)});
  }
  if (!ended) return fault("the file ends before the -9999 that ends a run");
  if (run.samples.size() < 2) return fault("the run has fewer than two wavenumbers");
  return {};
}

}  // namespace

bool is_tape7(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string line;
  // The cards of a run with an own atmosphere take a few hundred lines at most.
  for (int i = 0; i < 2000 && std::getline(in, line); ++i) {
    if (names_columns(line)) return true;
  }
  return false;
}

Result<std::vector<Tape7Run>> load_tape7(const fs::path& file) {
  return Tape7Reader(file).read();
}

std::optional<Tape7Air> tape7_air(const Tape7Run& run, const scene::SpectralBand& band) {
  EMIT_DCHECK(run.has_radiance || run.level_k);
  constexpr double kSourceK = 300.0;
  // The ends may lie off the samples by what the printed wavenumbers are rounded to.
  constexpr double kRoundingPerCm = 0.01;
  const physics::Band spectral = scene::spectral_band(band);
  const double low = kUmPerCm / band.hi_um;
  const double high = kUmPerCm / band.lo_um;
  const auto& samples = run.samples;
  if (samples.front().wavenumber_per_cm > low + kRoundingPerCm ||
      samples.back().wavenumber_per_cm < high - kRoundingPerCm) {
    return std::nullopt;
  }
  std::vector<double> nodes{low, high};
  for (const auto& sample : samples) nodes.push_back(sample.wavenumber_per_cm);
  for (const auto& point : band.response) nodes.push_back(kUmPerCm / point.wavelength_um);
  std::erase_if(nodes, [&](double n) { return n < low || n > high; });
  std::ranges::sort(nodes);
  // Planck's law per cm-1, for wavenumbers in cm-1.
  const auto planck = [](double per_cm, double kelvin) {
    constexpr double kC1L = physics::kRadianceC1WUm4PerM2Sr / 1e16;
    return kC1L * std::pow(per_cm, 3) / std::expm1(physics::kC2UmK * per_cm / (kUmPerCm * kelvin));
  };
  double weights = 0.0;
  double passed = 0.0;
  double radiance = 0.0;
  std::array<double, 3> before{};
  std::size_t s = 1;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    while (s + 1 < samples.size() && samples[s].wavenumber_per_cm < nodes[i]) ++s;
    const auto& a = samples[s - 1];
    const auto& b = samples[s];
    const double f = std::clamp(
        (nodes[i] - a.wavenumber_per_cm) / (b.wavenumber_per_cm - a.wavenumber_per_cm), 0.0, 1.0);
    const double source = planck(nodes[i], kSourceK);
    const double response =
        physics::response_frac(spectral, std::clamp(kUmPerCm / nodes[i], band.lo_um, band.hi_um));
    const double tau = a.transmittance_frac + f * (b.transmittance_frac - a.transmittance_frac);
    const double path = run.has_radiance
                            ? a.radiance_w_m2_sr_per_cm +
                                  f * (b.radiance_w_m2_sr_per_cm - a.radiance_w_m2_sr_per_cm)
                            : (1.0 - tau) * planck(nodes[i], *run.level_k);
    const std::array<double, 3> now{response * source, response * source * tau, response * path};
    if (i > 0) {
      const double half = 0.5 * (nodes[i] - nodes[i - 1]);
      weights += half * (before[0] + now[0]);
      passed += half * (before[1] + now[1]);
      radiance += half * (before[2] + now[2]);
    }
    before = now;
  }
  return Tape7Air{weights > 0.0 ? passed / weights : 1.0, radiance};
}

}  // namespace emit::config
