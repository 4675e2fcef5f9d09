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

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// Returns the columns of a line of names. Names are flush right with their numbers.
std::vector<Column> columns_of(std::string_view line) {
  std::vector<Column> columns;
  for (std::size_t at = line.find_first_not_of(" \r"); at != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(" \r", at), line.size());
    columns.push_back({std::string(line.substr(at, end - at)), end});
    at = line.find_first_not_of(" \r", end);
  }
  return columns;
}

/// Number of a field as Fortran prints it: an exponent of three digits has no E.
std::optional<double> fortran_number(std::string_view field) {
  std::string text(field);
  const std::size_t sign = text.find_last_of("+-");
  if (sign != std::string::npos && sign > 0 &&
      std::isdigit(static_cast<unsigned char>(text[sign - 1])) != 0) {
    text.insert(sign, "E");
  }
  double value = 0.0;
  const char* end = text.data() + text.size();
  const auto read = std::from_chars(text.data() + (text.starts_with('+') ? 1 : 0), end, value);
  if (read.ec != std::errc() || read.ptr != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// Field of a line between two places. Blank fields and lines that end before it are empty.
std::string_view field_of(std::string_view line, std::size_t begin, std::size_t end) {
  return begin < line.size() ? trimmed(line.substr(begin, end - begin)) : std::string_view{};
}

bool names_columns(std::string_view line) {
  return trimmed(line).starts_with("FREQ ");
}

/// Reads the path of a run from its cards. Its line has six fields: H1, H2, zenith angle, range,
/// angle at the earth's centre, and the earth's radius, by which the line is known.
bool read_path(std::string_view line, Tape7Run& run) {
  constexpr std::array<std::size_t, 7> kPlaces{0, 10, 20, 30, 40, 50, 62};
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
  return true;
}

/// Reader of one file, line by line.
class Reader {
 public:
  explicit Reader(const fs::path& file) : file_(file), in_(file, std::ios::binary) {}
  Result<std::vector<Tape7Run>> read() {
    if (!in_) {
      return make_error(fs::exists(file_) ? ErrorCode::io : ErrorCode::not_found,
                        fmt::format("{}: cannot be read", file_.string()));
    }
    std::vector<Tape7Run> runs;
    Tape7Run run;
    bool has_path = false;
    while (next()) {
      if (!names_columns(line_)) {
        has_path = read_path(line_, run) || has_path;
        continue;
      }
      run.line = number_;
      if (!has_path) return fault("no line of the cards before this one gives H1, angle and range");
      if (auto read = read_samples(run); !read) return tl::unexpected(read.error());
      runs.push_back(std::move(run));
      run = {};
      has_path = false;
    }
    if (runs.empty()) return fault("there is no run: no line names columns from FREQ on");
    return runs;
  }

 private:
  bool next() {
    if (!std::getline(in_, line_)) return false;
    ++number_;
    return true;
  }
  [[nodiscard]] tl::unexpected<physics::Error> fault(const std::string& text) const {
    return make_error(ErrorCode::config, fmt::format("{}:{}: {}", file_.string(), number_, text));
  }
  Result<void> read_samples(Tape7Run& run);
  fs::path file_;
  std::ifstream in_;
  std::string line_;
  std::uint32_t number_ = 0;
};

Result<void> Reader::read_samples(Tape7Run& run) {
  const std::vector<Column> columns = columns_of(line_);
  const auto place = [&columns](std::initializer_list<std::string_view> names) {
    for (const std::string_view name : names) {
      for (std::size_t i = 0; i < columns.size(); ++i) {
        if (columns[i].name == name) return i;
      }
    }
    return columns.size();
  };
  const std::size_t tau = place({"TOT_TRANS", "COMBIN", "TRANS"});
  if (tau == columns.size()) return fault("there is no column TOT_TRANS, COMBIN or TRANS");
  const std::size_t total = place({"TOTAL_RAD"});
  const std::array<std::size_t, 2> of_surface{place({"SURF_EMIS"}), place({"GRND_RFLT"})};
  run.has_radiance = total < columns.size();
  std::string wrong;
  const auto number = [&](std::size_t column) {
    if (column == columns.size()) return 0.0;
    const std::size_t begin = column == 0 ? 0 : columns[column - 1].end;
    const std::string_view field = field_of(line_, begin, columns[column].end);
    if (field.empty()) return 0.0;
    const auto value = fortran_number(field);
    if (!value)
      wrong = fmt::format("'{}' in column {} is not a number", field, columns[column].name);
    return value.value_or(0.0);
  };
  while (next()) {
    const std::string_view text = trimmed(line_);
    if (text.empty() || text.starts_with("CM-1")) continue;
    if (text.starts_with("-9999")) break;
    if (names_columns(line_))
      return fault("a run begins before the -9999 that ends the one before");
    Tape7Run::Sample sample{number(0), number(tau), number(total)};
    for (const std::size_t column : of_surface) sample.radiance_w_m2_sr_per_cm -= number(column);
    sample.radiance_w_m2_sr_per_cm = std::max(0.0, sample.radiance_w_m2_sr_per_cm * kWM2PerWCm2);
    if (!wrong.empty()) return fault(wrong);
    if (!(sample.transmittance_frac >= 0.0 && sample.transmittance_frac <= 1.0)) {
      return fault(
          fmt::format("the transmittance is {}, must be 0 .. 1", sample.transmittance_frac));
    }
    const double before = run.samples.empty() ? 0.0 : run.samples.back().wavenumber_per_cm;
    if (!(sample.wavenumber_per_cm > before)) {
      return fault(fmt::format("the wavenumber {} is not above {}, that of the line before",
                               sample.wavenumber_per_cm, before));
    }
    run.samples.push_back(sample);
  }
  if (run.samples.size() < 2) return fault("the run has fewer than two wavenumbers");
  return {};
}

/// Response of a band at a wavelength.
double response_at(const scene::SpectralBand& band, double um) {
  if (um < band.lo_um || um > band.hi_um) return 0.0;
  const auto& curve = band.response;
  if (curve.empty()) return 1.0;
  if (um < curve.front().wavelength_um || um > curve.back().wavelength_um) return 0.0;
  std::size_t i = 1;
  while (i + 1 < curve.size() && um > curve[i].wavelength_um) ++i;
  const double f =
      (um - curve[i - 1].wavelength_um) / (curve[i].wavelength_um - curve[i - 1].wavelength_um);
  return curve[i - 1].response_frac + f * (curve[i].response_frac - curve[i - 1].response_frac);
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
  return Reader(file).read();
}

std::optional<Tape7Air> tape7_air(const Tape7Run& run, const scene::SpectralBand& band) {
  constexpr double kSourceK = 300.0;
  // The ends may lie off the samples by what the printed wavenumbers are rounded to.
  constexpr double kRoundingPerCm = 0.01;
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
    // Only the shape of Planck's law over the wavenumber counts.
    const double source =
        std::pow(nodes[i], 3) / std::expm1(physics::kC2UmK * nodes[i] / (kUmPerCm * kSourceK));
    const double response =
        response_at(band, std::clamp(kUmPerCm / nodes[i], band.lo_um, band.hi_um));
    const double tau = a.transmittance_frac + f * (b.transmittance_frac - a.transmittance_frac);
    const double path =
        a.radiance_w_m2_sr_per_cm + f * (b.radiance_w_m2_sr_per_cm - a.radiance_w_m2_sr_per_cm);
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
