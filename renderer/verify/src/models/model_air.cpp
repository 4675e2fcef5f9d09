// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <span>
#include <tuple>

#include "emit/physics/air_model.hpp"
#include "emit/physics/air_view.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/sky/sun_scatter.hpp"
#include "gpu_rows.hpp"
#include "models.hpp"
#include "result_writer.hpp"

namespace emit::verify {

physics::Result<physics::Band> flat_band(std::string_view band) {
  double lo_um = 0.0;
  double hi_um = 0.0;
  const char* end = band.data() + band.size();
  const auto low = std::from_chars(band.data(), end, lo_um);
  const bool dash = low.ec == std::errc{} && low.ptr != end && *low.ptr == '-';
  const auto high = dash ? std::from_chars(low.ptr + 1, end, hi_um) : low;
  if (!dash || high.ec != std::errc{} || high.ptr != end) {
    return physics::make_error(physics::ErrorCode::parse,
                               "a band is two wavelengths in um, as 3-5");
  }
  return physics::Band{lo_um, hi_um, {}};
}

namespace {

using physics::AirColumn;
using physics::AirPath;
using physics::AirSource;
using physics::AirView;
using physics::BandAir;
using physics::CsvTable;
using physics::ErrorCode;
using physics::Result;
using physics::SunScatter;

/// Air of a flat band.
Result<BandAir> air_of(std::string_view band) {
  const auto flat = flat_band(band);
  if (!flat) return tl::unexpected(flat.error());
  return BandAir::build(*flat);
}

/// Air and band of every row of a table with the columns model, vis_km and band.
class AirRows {
 public:
  /// `lit` says that the table may name a sun whose light is scattered.
  static Result<AirRows> read(const CsvTable& table, bool lit) {
    auto models = table.texts("model");
    if (!models) return tl::unexpected(std::move(models.error()));
    auto bands = table.texts("band");
    if (!bands) return tl::unexpected(std::move(bands.error()));
    auto visibility_km = table.numbers("vis_km");
    if (!visibility_km) return tl::unexpected(std::move(visibility_km.error()));
    AirRows out;
    for (std::size_t i = 0; i < table.rows(); ++i) {
      const auto climate = physics::air_climate((*models)[i]);
      if (!climate) return fault(table, i, "model", (*models)[i], "no model atmosphere");
      const auto column_key = std::pair{*climate, (*visibility_km)[i]};
      if (!out.columns_.contains(column_key)) {
        auto column = AirColumn::build({*climate, (*visibility_km)[i], 1.0});
        if (!column)
          return fault(table, i, "vis_km", fmt::format("{}", (*visibility_km)[i]),
                       column.error().text);
        out.columns_.emplace(column_key, std::move(*column));
      }
      const std::string band((*bands)[i]);
      if (!out.bands_.contains(band)) {
        auto terms = air_of(band);
        if (!terms) return fault(table, i, "band", band, terms.error().text);
        out.bands_.emplace(band, std::move(*terms));
      }
      out.rows_.push_back({&out.columns_.at(column_key), &out.bands_.at(band), nullptr});
    }
    // Add the sun, if the table has it.
    if (!lit || !(table.has("sun_elevation_deg") || table.has("sun_azimuth_deg"))) return out;
    auto suns = read_columns<2>(table, {"sun_elevation_deg", "sun_azimuth_deg"});
    if (!suns) return tl::unexpected(std::move(suns.error()));
    out.suns_deg_ = std::move(*suns);
    for (std::size_t i = 0; i < table.rows(); ++i) {
      const std::pair key{out.rows_[i].column, std::string((*bands)[i])};
      if (!out.scatters_.contains(key)) {
        out.scatters_[key] = SunScatter::build(*key.first, *flat_band(key.second));
      }
      const auto& scatter = out.scatters_[key];
      out.rows_[i].scatter = scatter ? &*scatter : nullptr;
    }
    return out;
  }

  [[nodiscard]] const AirColumn& column(std::size_t row) const { return *rows_[row].column; }
  [[nodiscard]] const BandAir& band(std::size_t row) const { return *rows_[row].band; }

  /// Sun of a row, by its apparent elevation and its azimuth from the line of sight.
  struct Sun {
    const SunScatter* scatter = nullptr;  ///< null: nothing is scattered
    double elevation_rad = 0.0;
    double cosine = 0.0;  ///< of the angle between the line of sight and the sun
  };
  /// Returns the sun of a row for the sine of the elevation of its line of sight; empty if the
  /// row's sun is not defined.
  [[nodiscard]] std::optional<Sun> sun(std::size_t row, double sin_elevation) const {
    if (suns_deg_[0].empty()) return Sun{};
    const double elevation_rad = suns_deg_[0][row] * physics::kDegree;
    const double azimuth_rad = suns_deg_[1][row] * physics::kDegree;
    if (!(std::abs(suns_deg_[0][row]) <= 90.0) || !std::isfinite(azimuth_rad)) return std::nullopt;
    const double across = std::sqrt(std::max(0.0, 1.0 - sin_elevation * sin_elevation));
    return Sun{elevation_rad > 0.0 ? rows_[row].scatter : nullptr, elevation_rad,
               sin_elevation * std::sin(elevation_rad) +
                   across * std::cos(elevation_rad) * std::cos(azimuth_rad)};
  }
  /// Returns the sunlight that the path of a row scatters, W m-2 sr-1.
  [[nodiscard]] double scattered_w_m2_sr(std::size_t row, const AirPath& path,
                                         const Sun& sun) const {
    if (sun.scatter == nullptr) return 0.0;
    SunScatter::Kinds light{};
    sun.scatter->scattered_w_m2(path,
                                sun.scatter->beams(column(row), std::span(&sun.elevation_rad, 1)),
                                std::span(&light, 1));
    const auto phase = sun.scatter->phase_per_sr(sun.cosine);
    double sum = 0.0;
    for (std::size_t k = 0; k < light.size(); ++k) sum += light[k] * phase[k];
    return sum;
  }

  static tl::unexpected<physics::Error> fault(const CsvTable& table, std::size_t row,
                                              std::string_view column, std::string_view text,
                                              std::string_view why) {
    return physics::make_error(ErrorCode::parse,
                               fmt::format("{}:{}: column '{}': '{}': {}", table.name(),
                                           table.line_of(row), column, text, why));
  }

 private:
  struct Row {
    const AirColumn* column;
    const BandAir* band;
    const SunScatter* scatter;
  };
  std::array<std::vector<double>, 2> suns_deg_;  ///< elevation and azimuth; empty without a sun
  std::map<std::pair<const AirColumn*, std::string>, std::optional<SunScatter>> scatters_;
  std::map<std::pair<physics::AirClimate, double>, AirColumn> columns_;
  std::map<std::string, BandAir> bands_;
  std::vector<Row> rows_;
};

/// Lookup of one row in the table of its sensor, as a pixel has it.
struct Lookup {
  AirView::Sources sources{};
  double sensor_m = 0.0;
  bool sky = false;
  float place = 0.0F;  ///< height of the target, or for the sky the sine of the elevation
  float range_m = 0.0F;
  AirRows::Sun sun{};
};

/// Transmittances for the three sources, then the radiance, of rows in float32: by the functions of
/// AirView, or by the shader. Rows without a lookup are undefined.
class AirLookups {
 public:
  AirLookups(const AirRows& rows, const std::vector<std::optional<Lookup>>& lookups)
      : lookups_(lookups), first_(lookups.size()) {
    // Collect what each atmosphere is looked at for, then make all its views at once.
    using Subject = std::tuple<const BandAir*, AirView::Sources, const SunScatter*>;
    using Place = std::pair<double, double>;  // height of the sensor and elevation of the sun
    std::map<const AirColumn*, std::map<Subject, std::map<Place, std::vector<std::size_t>>>> wanted;
    for (std::size_t i = 0; i < lookups.size(); ++i) {
      if (!lookups[i]) continue;
      const Lookup& at = *lookups[i];
      wanted[&rows.column(i)][{&rows.band(i), at.sources, at.sun.scatter}]
            [{at.sensor_m, at.sun.scatter != nullptr ? at.sun.elevation_rad : 0.0}]
                .push_back(i);
    }
    for (const auto& [column, subjects] : wanted) {
      std::vector<AirView::Subject> list;
      for (const auto& [subject, places] : subjects) {
        list.push_back({std::get<0>(subject), std::get<1>(subject), std::get<2>(subject)});
      }
      const auto views = AirView::build(*column, list);
      std::size_t v = 0;
      for (const auto& [subject, places] : subjects) {
        for (const auto& [place, row_numbers] : places) {
          const std::size_t first = nodes_.size();
          nodes_.resize(first + AirView::kNodes);
          views[v].at(place.first, {}, std::span(nodes_).subspan(first));
          if (std::get<2>(subject) != nullptr) {
            // The scattered sunlight follows.
            nodes_.resize(first + AirView::kNodes + AirView::kSunNodes);
            views[v].sun_at(place.first,
                            {.sin_elevation = std::sin(place.second), .share_frac = 1.0},
                            std::span(nodes_).subspan(first + AirView::kNodes));
          }
          for (const std::size_t row : row_numbers) first_[row] = first;
        }
        ++v;
      }
    }
  }

  [[nodiscard]] Result<std::vector<AirView::Node>> evaluate(const EvaluateRequest& request) const {
    return request.device == Device::gpu ? by_shader(request.gpu_index) : on_cpu();
  }

 private:
  [[nodiscard]] std::vector<AirView::Node> on_cpu() const {
    std::vector<AirView::Node> out(lookups_.size(), undefined());
    for (std::size_t i = 0; i < lookups_.size(); ++i) {
      if (!lookups_[i]) continue;
      const Lookup& at = *lookups_[i];
      const auto table = std::span(nodes_).subspan(first_[i], AirView::kNodes);
      const auto seen = at.sky ? physics::air_sky(table, at.place)
                               : physics::air_sight(table, at.place, at.range_m);
      const auto& tau = seen.transmittance_frac;
      out[i] = {tau[0], tau[1], tau[2], seen.path_radiance_w_m2_sr};
      if (at.sun.scatter == nullptr) continue;
      const auto sun = std::span(nodes_).subspan(first_[i] + AirView::kNodes, AirView::kSunNodes);
      const auto phase = physics::air_sun_phase(sun, static_cast<float>(at.sun.cosine));
      if (at.sky) {
        out[i][3] += physics::air_sun_w_m2_sr(physics::air_sky_node(sun, at.place), phase);
      } else {
        auto node = physics::air_sight_node(table, at.place, at.range_m);
        node[3] =
            physics::air_sun_w_m2_sr(physics::air_sight_node(sun, at.place, at.range_m), phase);
        out[i][3] += physics::air_path_w_m2_sr(node, at.range_m);
      }
    }
    return out;
  }

  [[nodiscard]] Result<std::vector<AirView::Node>> by_shader(int gpu_index) const {
    std::vector<float> inputs;
    for (std::size_t i = 0; i < lookups_.size(); ++i) {
      const Lookup lookup = lookups_[i].value_or(Lookup{});
      const float sun_first =
          lookup.sun.scatter != nullptr ? static_cast<float>(first_[i] + AirView::kNodes) : -1.0F;
      inputs.insert(inputs.end(),
                    {static_cast<float>(first_[i]), lookup.sky ? 1.0F : 0.0F, lookup.place,
                     lookup.range_m, sun_first, static_cast<float>(lookup.sun.cosine), 0.0F, 0.0F});
    }
    std::vector<float> constants;
    for (const AirView::Node& node : nodes_) {
      constants.insert(constants.end(), node.begin(), node.end());
    }
    if (constants.empty()) return std::vector<AirView::Node>(lookups_.size(), undefined());
    GpuRows job;
    job.shader = "passes/evaluate_air.comp";
    job.inputs = inputs;
    job.input_stride = 8;
    job.output_stride = 4;
    job.constants = constants;
    job.gpu_index = gpu_index;
    const auto raw = run_gpu_rows(job);
    if (!raw) return tl::unexpected(raw.error());
    std::vector<AirView::Node> out(lookups_.size(), undefined());
    for (std::size_t i = 0; i < out.size(); ++i) {
      if (lookups_[i])
        std::copy_n(raw->begin() + static_cast<std::ptrdiff_t>(4 * i), 4, out[i].begin());
    }
    return out;
  }

  static AirView::Node undefined() {
    AirView::Node node;
    node.fill(kUndefined<float>);
    return node;
  }

  const std::vector<std::optional<Lookup>>& lookups_;
  std::vector<std::size_t> first_;  ///< first node of the row's table
  std::vector<AirView::Node> nodes_;
};

/// Returns the source of that name in the tables.
std::optional<AirSource> source_of(std::string_view name) {
  if (name == "300K") return AirSource::black_300k;
  if (name == "800K") return AirSource::black_800k;
  if (name == "sun") return AirSource::sun_5772k;
  if (name == "flat") return AirSource::flat;
  return std::nullopt;
}

}  // namespace

Result<std::string> run_air_path(const EvaluateRequest& request, const CsvTable& table) {
  auto air = AirRows::read(table, true);
  if (!air) return tl::unexpected(std::move(air.error()));
  auto sources = table.texts("source");
  if (!sources) return tl::unexpected(std::move(sources.error()));
  auto columns = read_columns<3>(table, {"h_sensor_m", "h_target_m", "range_m"});
  if (!columns) return tl::unexpected(std::move(columns.error()));
  const auto& [sensor_m, target_m, range_m] = *columns;
  std::vector<std::vector<double>> out(2, std::vector<double>(table.rows(), kUndefined<double>));
  std::vector<std::optional<Lookup>> lookups(table.rows());
  const bool exact = request.precision == Precision::float64;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const auto source = source_of((*sources)[i]);
    if (!source) {
      return AirRows::fault(table, i, "source", (*sources)[i], "not 300K, 800K, sun or flat");
    }
    if (!(range_m[i] >= 0.0) || !std::isfinite(range_m[i] + sensor_m[i] + target_m[i])) continue;
    const double climb = range_m[i] > 0.0 ? (target_m[i] - sensor_m[i]) / range_m[i] : 0.0;
    const auto sun = air->sun(i, std::clamp(climb, -1.0, 1.0));
    if (!sun) continue;
    if (!exact) {
      lookups[i] = Lookup{
          {*source, *source, *source},    sensor_m[i], false, static_cast<float>(target_m[i]),
          static_cast<float>(range_m[i]), *sun};
      continue;
    }
    const auto path = AirPath::between(air->column(i), sensor_m[i], target_m[i], range_m[i]);
    out[0][i] = air->band(i).transmittance(path, *source);
    out[1][i] = air->band(i).path_radiance_w_m2_sr(path) + air->scattered_w_m2_sr(i, path, *sun);
  }
  if (exact) return write_csv(kAirPathOutputs, out);
  const auto seen = AirLookups(*air, lookups).evaluate(request);
  if (!seen) return tl::unexpected(seen.error());
  std::vector<std::vector<float>> single(2);
  for (const AirView::Node& row : *seen) {
    single[0].push_back(row[0]);
    single[1].push_back(row[3]);
  }
  return write_csv(kAirPathOutputs, single);
}

Result<std::string> run_air_sky(const EvaluateRequest& request, const CsvTable& table) {
  auto air = AirRows::read(table, true);
  if (!air) return tl::unexpected(std::move(air.error()));
  auto columns = read_columns<2>(table, {"h_sensor_m", "elevation_deg"});
  if (!columns) return tl::unexpected(std::move(columns.error()));
  const auto& [sensor_m, elevation_deg] = *columns;
  std::vector<std::vector<double>> out(3, std::vector<double>(table.rows(), kUndefined<double>));
  std::vector<std::optional<Lookup>> lookups(table.rows());
  const bool exact = request.precision == Precision::float64;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    if (!(std::abs(elevation_deg[i]) <= 90.0) || !std::isfinite(sensor_m[i])) continue;
    const double elevation_rad = elevation_deg[i] * physics::kDegree;
    const auto sun = air->sun(i, std::sin(elevation_rad));
    if (!sun) continue;
    if (!exact) {
      lookups[i] = Lookup{{AirSource::flat, AirSource::sun_5772k, AirSource::sun_lowtran},
                          sensor_m[i],
                          true,
                          static_cast<float>(std::sin(elevation_rad)),
                          0.0F,
                          *sun};
      continue;
    }
    const auto path = AirPath::to_space(air->column(i), sensor_m[i], elevation_rad);
    out[0][i] = air->band(i).transmittance(path, AirSource::flat);
    out[1][i] = air->band(i).transmittance(path, AirSource::sun_5772k);
    out[2][i] = air->band(i).path_radiance_w_m2_sr(path) + air->scattered_w_m2_sr(i, path, *sun);
  }
  if (exact) return write_csv(kAirSkyOutputs, out);
  const auto seen = AirLookups(*air, lookups).evaluate(request);
  if (!seen) return tl::unexpected(seen.error());
  std::vector<std::vector<float>> single(3);
  for (const AirView::Node& row : *seen) {
    single[0].push_back(row[0]);
    single[1].push_back(row[1]);
    single[2].push_back(row[3]);
  }
  return write_csv(kAirSkyOutputs, single);
}

Result<std::string> run_air_sun(const EvaluateRequest& request, const CsvTable& table) {
  auto air = AirRows::read(table, false);
  if (!air) return tl::unexpected(std::move(air.error()));
  const auto elevation_deg = table.numbers("sun_elevation_deg");
  if (!elevation_deg) return tl::unexpected(elevation_deg.error());
  std::vector<std::vector<double>> out(1, std::vector<double>(table.rows(), kUndefined<double>));
  std::vector<std::optional<Lookup>> lookups(table.rows());
  const bool exact = request.precision == Precision::float64;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    if (!(std::abs((*elevation_deg)[i]) <= 90.0)) continue;
    const double elevation_rad = (*elevation_deg)[i] * physics::kDegree;
    out[0][i] = 0.0;
    if (elevation_rad < 0.0) continue;
    if (exact) {
      out[0][i] = air->band(i).sun_w_m2(AirPath::to_space(air->column(i), 0.0, elevation_rad));
    } else {
      lookups[i] = Lookup{{AirSource::flat, AirSource::sun_5772k, AirSource::sun_lowtran},
                          0.0,
                          true,
                          static_cast<float>(std::sin(elevation_rad)),
                          0.0F,
                          {}};
    }
  }
  if (exact) return write_csv(kAirSunOutputs, out);
  const auto seen = AirLookups(*air, lookups).evaluate(request);
  if (!seen) return tl::unexpected(seen.error());
  std::vector<std::vector<float>> single(1);
  for (std::size_t i = 0; i < table.rows(); ++i) {
    single[0].push_back(lookups[i]
                            ? static_cast<float>(air->band(i).sun_outside_w_m2()) * (*seen)[i][2]
                            : static_cast<float>(out[0][i]));
  }
  return write_csv(kAirSunOutputs, single);
}

}  // namespace emit::verify
