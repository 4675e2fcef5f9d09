// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tool/logger/ground_signs.hpp"
#include "tool/logger/logger_options.hpp"

/// One measured day against the model of level ground, with the published uncertainty of every
/// input carried through.
namespace emit::tool {

/// Effect of the uncertainty of one input. Its sizes are differences of "model less measurement" to
/// the run without the change.
struct InputEffect {
  std::string input;
  std::string range;   ///< as text, with both signs
  std::string source;  ///< of the range
  double rms_k = 0.0;  ///< larger of both signs, over the record
  double max_k = 0.0;
  // Fitted numbers with the input at its low and its high end; of the fitted case only.
  reference::PlateNumbers low_numbers;
  reference::PlateNumbers high_numbers;
};

/// Model, its difference to the measurement, and its band.
struct NatureCase {
  reference::PlateNumbers numbers;
  std::vector<double> model_k;
  std::vector<double> low_k;   ///< lower end of the band, effects added in squares
  std::vector<double> high_k;  ///< upper end
  double within_frac = 0.0;    ///< share of rows whose measurement lies in the band
  Difference difference;
  std::vector<InputEffect> effects;
};

struct NatureDay {
  LoggerRecord record;
  MeasuredGround ground;
  DayHeat heat;
  std::vector<GroundSign> signs;
  NatureCase library;  ///< nothing fitted
  /// Nothing fitted, with the modes and the step of the real-time model in place of the layers.
  Difference real_time;
  NatureCase fitted;        ///< inertia and base fitted; refitted for every change of an input
  reference::PlateFit fit;  ///< of the case `fitted` without a change
};

/// Runs a day. `on_run` is called after every run and fit. Errors: those of read_logger(),
/// measured_ground() and reference::fit_plate(), naming the file.
[[nodiscard]] physics::Result<NatureDay> study_day(const std::filesystem::path& file,
                                                   const LoggerOptions& record_options,
                                                   const GroundOptions& ground_options,
                                                   const std::function<void()>& on_run);
/// Number of calls of `on_run` in study_day().
[[nodiscard]] std::size_t study_runs() noexcept;

}  // namespace emit::tool
