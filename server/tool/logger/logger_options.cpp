// SPDX-License-Identifier: Apache-2.0
#include "tool/logger/logger_options.hpp"

#include <algorithm>
#include <cmath>

namespace emit::tool {

std::vector<Option> add_logger_options(CommandLine& line, LoggerOptions& options) {
  return {
      line.option("--column", options.columns,
                  "Name that the file gives a column, as air_c=T_air; repeatable")
          .repeatable()
          .type_name("COLUMN=NAME"),
      line.option("--lat-deg", options.lat_deg,
                  "Latitude, north positive; default: of a comment line")
          .in_range(-90.0, 90.0),
      line.option("--lon-deg", options.lon_deg,
                  "Longitude, east positive; default: of a comment line")
          .in_range(-180.0, 180.0),
      line.option("--height-m", options.height_m,
                  "Height above the sea; default: of a comment line, else 0")
          .in_range(-500.0, 9000.0),
      line.option("--date", options.date, "Date of time 0, UTC; default: of a comment line")
          .type_name("YYYY-MM-DD"),
      line.option("--surface", options.surface,
                  "What the ground is in words, such as \"moist grass\"; comment lines count too")
          .type_name("WORDS")};
}

std::vector<Option> add_ground_options(CommandLine& line, GroundOptions& options) {
  return {line.option("--absorptance", options.absorptance_frac,
                      "Absorbed share of sunlight; default: 1 less reflected_w_m2 over ghi_w_m2, "
                      "else that of the material")
              .in_range(0.0, 1.0),
          line.option("--emissivity", options.emissivity_frac,
                      "Long-wave emissivity, for the model and for longwave_up_w_m2; default: that "
                      "of the material")
              .in_range(0.05, 1.0),
          line.option("--base-k", options.base_k,
                      "Temperature below the last layer; default: that of the material, by place "
                      "and date for ground")
              .in_range(150.0, 400.0)};
}

PlotSeries record_series(std::string label, const LoggerRecord& record,
                         const std::vector<double>& values) {
  constexpr std::size_t kMostPoints = 600;
  PlotSeries series{.label = std::move(label), .points = {}, .line = true, .markers = false};
  const std::size_t stride =
      std::max<std::size_t>(1, (values.size() + kMostPoints - 1) / kMostPoints);
  for (std::size_t i = 0; i < values.size(); i += stride) {
    series.points.push_back({record.rows[i].time_s / 3600.0, values[i], {}});
  }
  return series;
}

Plot record_plot(std::string title, std::string y_label) {
  return {.title = std::move(title),
          .x = {.label = "time of the record, h"},
          .y = {.label = std::move(y_label)},
          .series = {}};
}

Difference difference_of(const LoggerRecord& record, const std::vector<double>& model_k) {
  Difference out;
  const double start_s = record.rows.front().time_s;
  for (std::size_t i = 0; i < model_k.size(); ++i) {
    const double error_k = model_k[i] - record.rows[i].surface_k;
    out.rms_k += error_k * error_k;
    out.bias_k += error_k;
    out.max_k = std::max(out.max_k, std::abs(error_k));
    const auto hour = static_cast<std::size_t>((record.rows[i].time_s - start_s) / 3600.0);
    if (out.max_by_hour_k.size() <= hour) out.max_by_hour_k.resize(hour + 1, 0.0);
    out.max_by_hour_k[hour] = std::max(out.max_by_hour_k[hour], std::abs(error_k));
  }
  const auto count = static_cast<double>(model_k.size());
  out.rms_k = std::sqrt(out.rms_k / count);
  out.bias_k /= count;
  return out;
}

void add_difference(Json& json, const Difference& difference) {
  Json hours = Json::array();
  for (const double max_k : difference.max_by_hour_k) hours.push(max_k);
  json.set("rms_k", difference.rms_k)
      .set("bias_k", difference.bias_k)
      .set("max_k", difference.max_k)
      .set("max_by_hour_k", std::move(hours));
}

}  // namespace emit::tool
