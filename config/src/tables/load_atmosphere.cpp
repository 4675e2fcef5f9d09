// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "emit/physics/constants.hpp"
#include "emit/physics/csv.hpp"
#include "emit/physics/nearest_name.hpp"
#include "tables.hpp"
#include "tape7.hpp"
#include "typed_table.hpp"

/// Reader of atmospheres: a table by range and elevation, or the terms of a sum of exponentials.
namespace emit::config {

using physics::ErrorCode;
using physics::Result;
using scene::BandAtmosphere;

namespace {

namespace fs = std::filesystem;

tl::unexpected<physics::Error> fault(const fs::path& file, std::uint32_t line,
                                     const std::string& text) {
  return physics::make_error(ErrorCode::config,
                             fmt::format("{}:{}: {}", file.string(), line, text));
}

Result<void> check_band(const fs::path& file, const TableRow& row,
                        const std::vector<std::string>& known_bands) {
  if (std::find(known_bands.begin(), known_bands.end(), row.texts[0]) != known_bands.end()) {
    return {};
  }
  std::string listed;
  for (const std::string& name : known_bands) {
    listed += (listed.empty() ? "" : ", ") + name;
  }
  return fault(file, row.line,
               fmt::format("there is no band '{}'{} (known: {})", row.texts[0],
                           physics::did_you_mean(row.texts[0], known_bands), listed));
}

Result<std::vector<BandAtmosphere>> load_terms(const fs::path& file,
                                               const std::vector<std::string>& known_bands) {
  const Result<std::vector<TableRow>> rows =
      read_typed_table(file, {{"band", true, any_number(), true},
                              {"amplitude_frac", true, between(0, 1)},
                              {"extinction_per_km", true, at_least(0)},
                              {"vertical_transmittance_frac", true, between(0, 1)}});
  if (!rows) {
    return tl::unexpected<physics::Error>(rows.error());
  }
  std::vector<BandAtmosphere> out;
  std::vector<std::uint32_t> first_line;
  for (const TableRow& row : *rows) {
    std::size_t index = 0;
    while (index < out.size() && out[index].band != row.texts[0]) {
      ++index;
    }
    if (index == out.size()) {
      if (auto known = check_band(file, row, known_bands); !known) {
        return tl::unexpected<physics::Error>(known.error());
      }
      BandAtmosphere entry;
      entry.band = row.texts[0];
      entry.vertical_transmittance_frac = *row.numbers[3];
      out.push_back(std::move(entry));
      first_line.push_back(row.line);
    }
    if (out[index].vertical_transmittance_frac != *row.numbers[3]) {
      return fault(file, row.line, "'vertical_transmittance_frac' differs within one band");
    }
    out[index].terms.push_back({*row.numbers[1], *row.numbers[2]});
  }
  for (std::size_t i = 0; i < out.size(); ++i) {
    double sum = 0.0;
    for (const scene::AtmosphereTerm& term : out[i].terms) {
      sum += term.amplitude_frac;
    }
    if (std::abs(sum - 1.0) > 1e-3 || out[i].terms.size() > limits::kMaxAtmosphereTerms) {
      return fault(file, first_line[i],
                   fmt::format("the amplitudes of band '{}' add up to {} over {} rows, "
                               "must be 1 over at most {}",
                               out[i].band, sum, out[i].terms.size(), limits::kMaxAtmosphereTerms));
    }
  }
  return out;
}

/// One row of a table.
struct Point {
  double range_m = 0.0;
  double transmittance_frac = 0.0;
  double path_radiance_w_m2_sr = 0.0;
  std::uint32_t line = 0;
};

struct BandRows {
  std::string name;
  std::map<double, std::vector<Point>> by_elevation_deg;
};

/// Adds a row. Bands and elevations may come in any order; ranges increase along one line of sight.
Result<void> add_row(const fs::path& file, const TableRow& row, BandRows& band) {
  const double elevation_deg = *row.numbers[2];
  const Point point{*row.numbers[1], *row.numbers[3], *row.numbers[4], row.line};
  std::vector<Point>& points = band.by_elevation_deg[elevation_deg];
  for (const Point& other : points) {
    if (other.range_m == point.range_m) {
      return fault(file, row.line,
                   fmt::format("band '{}', elevation {} deg, range {} m is already in line {}",
                               band.name, elevation_deg, point.range_m, other.line));
    }
  }
  if (!points.empty() && point.range_m < points.back().range_m) {
    return fault(file, row.line,
                 fmt::format("'range_m' ({}) is below that of line {} ({}) of the same band and "
                             "elevation: ranges must ascend",
                             point.range_m, points.back().line, points.back().range_m));
  }
  if (point.range_m == 0.0 &&
      (point.transmittance_frac != 1.0 || point.path_radiance_w_m2_sr != 0.0)) {
    return fault(file, row.line, "at range 0 transmittance must be 1 and path radiance 0");
  }
  if (!points.empty() && point.transmittance_frac > points.back().transmittance_frac) {
    return fault(file, row.line,
                 fmt::format("'transmittance_frac' ({}) rises with range: line {} has {}",
                             point.transmittance_frac, points.back().line,
                             points.back().transmittance_frac));
  }
  points.push_back(point);
  return {};
}

/// Makes the grid of a band. Every elevation has to have the ranges of the lowest one.
Result<BandAtmosphere> grid_of(const fs::path& file, const BandRows& band) {
  BandAtmosphere out;
  out.band = band.name;
  const auto& [first_deg, first] = *band.by_elevation_deg.begin();
  for (const Point& point : first) {
    out.table.range_m.push_back(point.range_m);
  }
  if (first.size() == 1 && first[0].range_m == 0.0) {
    return fault(file, first[0].line, fmt::format("band '{}' has no range beyond 0 m", band.name));
  }
  for (const auto& [elevation_deg, points] : band.by_elevation_deg) {
    for (std::size_t i = 0; i < std::max(points.size(), first.size()); ++i) {
      if (i < points.size() && i < first.size() && points[i].range_m == first[i].range_m) {
        continue;
      }
      // The other line of sight lacks the smaller of the two ranges.
      const bool lacking =
          i == points.size() || (i < first.size() && first[i].range_m < points[i].range_m);
      if (lacking) {
        return fault(
            file, points.back().line,
            fmt::format("band '{}': elevation {} deg has no row of range {} m, which "
                        "elevation {} deg has in line {}; all elevations of a band need "
                        "the same ranges",
                        band.name, elevation_deg, first[i].range_m, first_deg, first[i].line));
      }
      return fault(file, points[i].line,
                   fmt::format("band '{}': elevation {} deg has no row of range {} m, which "
                               "elevation {} deg has here; all elevations of a band need the same "
                               "ranges",
                               band.name, first_deg, points[i].range_m, elevation_deg));
    }
    out.table.elevation_rad.push_back(elevation_deg * physics::kDegree);
    for (const Point& point : points) {
      out.table.transmittance_frac.push_back(point.transmittance_frac);
      out.table.path_radiance_w_m2_sr.push_back(point.path_radiance_w_m2_sr);
    }
  }
  if (auto valid = physics::validate(out.table); !valid) {
    return fault(file, first[0].line, fmt::format("band '{}': {}", band.name, valid.error().text));
  }
  return out;
}

Result<std::vector<BandAtmosphere>> load_table(const fs::path& file,
                                               const std::vector<std::string>& known_bands) {
  const Result<std::vector<TableRow>> rows =
      read_typed_table(file, {{"band", true, any_number(), true},
                              {"range_m", true, between(0, 1e7)},
                              {"elevation_deg", true, between(-90, 90)},
                              {"transmittance_frac", true, between(0, 1)},
                              {"path_radiance_w_m2_sr", true, between(0, 1e6)}});
  if (!rows) {
    return tl::unexpected<physics::Error>(rows.error());
  }
  std::vector<BandRows> bands;
  for (const TableRow& row : *rows) {
    auto band = std::find_if(bands.begin(), bands.end(),
                             [&row](const BandRows& other) { return other.name == row.texts[0]; });
    if (band == bands.end()) {
      if (auto known = check_band(file, row, known_bands); !known) {
        return tl::unexpected<physics::Error>(known.error());
      }
      bands.push_back({row.texts[0], {}});
      band = bands.end() - 1;
    }
    if (auto added = add_row(file, row, *band); !added) {
      return tl::unexpected<physics::Error>(added.error());
    }
  }
  std::vector<BandAtmosphere> out;
  for (const BandRows& band : bands) {
    auto grid = grid_of(file, band);
    if (!grid) {
      return tl::unexpected<physics::Error>(grid.error());
    }
    out.push_back(std::move(*grid));
  }
  return out;
}

/// Returns a text for a line of sight in messages.
std::string sight_text(const Tape7Run& run) {
  return fmt::format("elevation {:.4g} deg and range {:.6g} m", run.elevation_deg, run.range_m);
}

/// Picks the runs that a table can be made of, in the order of elevation and range. Runs without
/// radiance may stand beside runs of the same line of sight that have it; else their path is level.
Result<std::vector<const Tape7Run*>> pick_runs(const fs::path& file,
                                               const std::vector<Tape7Run>& runs) {
  const auto same = [](const Tape7Run& a, const Tape7Run& b) {
    return std::abs(a.elevation_deg - b.elevation_deg) < 1e-3 &&
           std::abs(a.range_m - b.range_m) < 1e-3 * a.range_m;
  };
  std::vector<const Tape7Run*> picked;
  for (const Tape7Run& run : runs) {
    if (std::abs(run.sensor_m - runs.front().sensor_m) > 1.0) {
      return fault(file, run.line,
                   fmt::format("this run is for a sensor at {} m, the one of line {} for {} m: a "
                               "table holds for one height",
                               run.sensor_m, runs.front().line, runs.front().sensor_m));
    }
    if (run.has_radiance) {
      picked.push_back(&run);
      continue;
    }
    const bool paired = std::ranges::any_of(
        runs, [&](const Tape7Run& other) { return other.has_radiance && same(run, other); });
    if (paired) continue;
    if (!run.level_k) {
      return fault(file, run.line,
                   fmt::format("the run of {} has transmittances only, and its path is not level "
                               "in a model atmosphere: run it with radiance (IEMSCT 1 or 2)",
                               sight_text(run)));
    }
    picked.push_back(&run);
  }
  std::ranges::sort(picked, [](const Tape7Run* a, const Tape7Run* b) {
    return a->elevation_deg != b->elevation_deg ? a->elevation_deg < b->elevation_deg
                                                : a->range_m < b->range_m;
  });
  return picked;
}

Result<std::vector<BandAtmosphere>> load_runs(const fs::path& file,
                                              const std::vector<scene::SpectralBand>& bands) {
  const auto runs = load_tape7(file);
  if (!runs) return tl::unexpected<physics::Error>(runs.error());
  const auto picked = pick_runs(file, *runs);
  if (!picked) return tl::unexpected<physics::Error>(picked.error());
  // Paths out of the atmosphere have a range of their own each, and stand for the same column of
  // the table. Other ranges may differ by what the cards are rounded to.
  std::vector<double> ranges_m;
  for (const Tape7Run* run : *picked) {
    if (run->leaves_air) ranges_m.push_back(run->range_m);
  }
  const double out_m = ranges_m.empty() ? 0.0 : *std::ranges::max_element(ranges_m);
  ranges_m.assign(ranges_m.empty() ? 0 : 1, out_m);
  const auto range_of = [&](const Tape7Run& run) {
    if (run.leaves_air) return out_m;
    for (const double known_m : ranges_m) {
      if (std::abs(known_m - run.range_m) < 1e-4 * known_m) return known_m;
    }
    return ranges_m.emplace_back(run.range_m);
  };
  std::vector<BandAtmosphere> out;
  for (const scene::SpectralBand& band : bands) {
    BandRows rows{band.name, {}};
    const Tape7Run* lacking = nullptr;
    for (const Tape7Run* run : *picked) {
      const auto air = tape7_air(*run, band);
      if (!air) {
        lacking = run;
        continue;
      }
      const TableRow row{run->line,
                         {0.0, range_of(*run), run->elevation_deg, air->transmittance_frac,
                          air->path_radiance_w_m2_sr},
                         {}};
      if (auto added = add_row(file, row, rows); !added) {
        return tl::unexpected<physics::Error>(added.error());
      }
    }
    // A file need not have all bands, but no part of one.
    if (rows.by_elevation_deg.empty()) continue;
    if (lacking != nullptr) {
      return fault(file, lacking->line,
                   fmt::format("the run of {} covers {} .. {} cm-1, which is not all of band '{}'",
                               sight_text(*lacking), lacking->samples.front().wavenumber_per_cm,
                               lacking->samples.back().wavenumber_per_cm, band.name));
    }
    auto grid = grid_of(file, rows);
    if (!grid) return tl::unexpected<physics::Error>(grid.error());
    out.push_back(std::move(*grid));
  }
  if (out.empty()) {
    return fault(file, picked->front()->line,
                 fmt::format("the run covers {} .. {} cm-1, which holds none of the bands",
                             picked->front()->samples.front().wavenumber_per_cm,
                             picked->front()->samples.back().wavenumber_per_cm));
  }
  return out;
}

}  // namespace

Result<std::vector<BandAtmosphere>> load_atmosphere(const fs::path& file,
                                                    const std::vector<scene::SpectralBand>& bands,
                                                    const std::vector<std::string>& known_bands) {
  return is_tape7(file) ? load_runs(file, bands) : load_atmosphere_csv(file, known_bands);
}

Result<std::vector<BandAtmosphere>> load_atmosphere_csv(
    const fs::path& file, const std::vector<std::string>& known_bands) {
  const Result<physics::CsvReader> reader = physics::CsvReader::open(file);
  if (!reader) {
    return tl::unexpected<physics::Error>(reader.error());
  }
  const bool terms = std::ranges::any_of(reader->header(), [](const physics::CsvCell& cell) {
    return cell.text == "amplitude_frac" || cell.text == "extinction_per_km" ||
           cell.text == "vertical_transmittance_frac";
  });
  return terms ? load_terms(file, known_bands) : load_table(file, known_bands);
}

}  // namespace emit::config
