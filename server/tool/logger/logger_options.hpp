// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "tool/command_line/command_line.hpp"
#include "tool/logger/logger_file.hpp"
#include "tool/logger/measured_ground.hpp"
#include "tool/support/json.hpp"
#include "tool/support/svg_plot.hpp"

/// Options of all commands that read loggers, and their way to show a record.
namespace emit::tool {

/// Adds --column, --lat-deg, --lon-deg, --height-m, --date, --surface, and returns them.
std::vector<Option> add_logger_options(CommandLine& line, LoggerOptions& options);
/// Adds --absorptance, --emissivity, --base-k, and returns them.
std::vector<Option> add_ground_options(CommandLine& line, GroundOptions& options);

/// Returns a curve over the hours of the record, thinned to at most 600 points.
[[nodiscard]] PlotSeries record_series(std::string label, const LoggerRecord& record,
                                       const std::vector<double>& values);
/// Returns an empty diagram over the hours of the record.
[[nodiscard]] Plot record_plot(std::string title, std::string y_label);

/// Difference of a model and the measured surface.
struct Difference {
  double rms_k = 0.0;
  double bias_k = 0.0;  ///< model less measurement
  double max_k = 0.0;
  std::vector<double> max_by_hour_k;  ///< greatest size in every hour of the record
};
/// @pre model_k has a value for every row
[[nodiscard]] Difference difference_of(const LoggerRecord& record,
                                       const std::vector<double>& model_k);
void add_difference(Json& json, const Difference& difference);

}  // namespace emit::tool
