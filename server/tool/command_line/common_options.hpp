// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tool/command_line/command_line.hpp"
#include "tool/support/scenario_input.hpp"

/// Options that several commands have, so that they are called and explained alike.
namespace emit::tool {

/// --json FILE, with "-" for standard output.
Option add_json(CommandLine& line, std::optional<std::filesystem::path>& target);
/// --set KEY=VALUE, repeatable.
void add_set(CommandLine& line, std::vector<std::string>& target);
/// The scenario under `name`, required, and --set.
void add_scenario(CommandLine& line, ScenarioChoice& target, const std::string& name);
/// Reads a multiple of a pace: a positive number, or "max", for which 0 stands. Empty: neither.
[[nodiscard]] std::optional<double> parse_speed(const std::string& text);

/// Converts an option's simulation time from seconds to nanoseconds; absent stays absent. Errors
/// (invalid_argument): it is out of range; the message names the option.
[[nodiscard]] physics::Result<std::optional<std::int64_t>> sim_time_ns(
    std::string_view option, std::optional<double> time_s);
/// --from-s and --to-s: the range of simulation time that is exported.
void add_time_range(CommandLine& line, std::optional<double>& from_s, std::optional<double>& to_s);
/// --gpu N.
void add_gpu(CommandLine& line, int& target);
/// --png-of QUANTITY: what the colours of a PNG stand for. `surface`: the frames carry temperatures
/// of surfaces, so that these can be shown.
void add_png_of(CommandLine& line, std::string& target, bool surface);
/// --width and --height of the image, px.
void add_image_size(CommandLine& line, std::uint32_t& width_px, std::uint32_t& height_px);

}  // namespace emit::tool
