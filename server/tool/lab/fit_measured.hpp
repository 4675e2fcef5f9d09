// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tool/command_line/command_line.hpp"
#include "tool/logger/logger_file.hpp"
#include "tool/logger/measured_ground.hpp"

/// `emit fit --measured`: numbers of the ground from the record of a logger.
namespace emit::tool {

struct MeasuredFitOptions {
  std::filesystem::path logger;  ///< empty: the command has no --measured
  std::vector<std::string> numbers;
  LoggerOptions record;
  GroundOptions ground;
  std::optional<std::filesystem::path> plot;
  std::optional<std::filesystem::path> history;
  // These are options of all fits.
  std::optional<std::filesystem::path> toml;
  std::optional<std::filesystem::path> json;
};

/// Adds the options that count with --measured alone.
void add_measured_fit_options(CommandLine& line, MeasuredFitOptions& options);

/// Returns the exit code of the process.
[[nodiscard]] int run_measured_fit(const MeasuredFitOptions& options);

}  // namespace emit::tool
