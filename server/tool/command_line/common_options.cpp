// SPDX-License-Identifier: Apache-2.0
#include "tool/command_line/common_options.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "emit/config/load.hpp"
#include "emit/physics/limits.hpp"

namespace emit::tool {

Option add_json(CommandLine& line, std::optional<std::filesystem::path>& target) {
  return line.output_file("--json", target, "Write the results as JSON (- for standard output)");
}

void add_time_range(CommandLine& line, std::optional<double>& from_s, std::optional<double>& to_s) {
  line.option("--from-s", from_s, "First simulation time; default: the begin").type_name("S");
  line.option("--to-s", to_s, "Last simulation time; default: the end").type_name("S");
}

void add_set(CommandLine& line, std::vector<std::string>& target) {
  line.option("--set", target, "Override a key of the file, e.g. --set thermal.steps=90")
      .repeatable()
      .type_name("KEY=VALUE");
}

void add_scenario(CommandLine& line, ScenarioChoice& target, const std::string& name) {
  line.option(name, target.scenario, "Shipped scenario (airfield, box, ...) or a .toml file")
      .required()
      .type_name("SCENARIO")
      .suggest(config::shipped_scenarios)
      .may_be_file();
  add_set(line, target.set);
}

std::optional<double> parse_speed(const std::string& text) {
  if (text == "max") return 0.0;
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  if (!std::isfinite(value) || value <= 0.0) return std::nullopt;
  return value;
}

physics::Result<std::optional<std::int64_t>> sim_time_ns(std::string_view option,
                                                         std::optional<double> time_s) {
  if (!time_s) return std::nullopt;
  constexpr double kMaxTimeS = physics::limits::kMaxSimTimeS;
  if (!(std::abs(*time_s) <= kMaxTimeS)) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               fmt::format("{}: {} s is out of range, must be {} .. {}", option,
                                           *time_s, -kMaxTimeS, kMaxTimeS));
  }
  return std::llround(*time_s * 1e9);
}

void add_gpu(CommandLine& line, int& target) {
  line.option("--gpu", target, "EGL device index; default: first hardware device, else Mesa")
      .type_name("N");
}

void add_png_of(CommandLine& line, std::string& target, bool surface) {
  std::vector<std::string> names{"apparent", "radiance"};
  std::string text =
      "What the colours of the PNG stand for. apparent: temperature of a blackbody with the "
      "pixel's "
      "radiance in the band, as the sensor sees it; radiance: radiance in the band";
  if (surface) {
    names.emplace_back("temperature");
    text += "; temperature: temperature of the surface itself, without sky";
  }
  line.option("--png-of", target, text).one_of(names).type_name("QUANTITY").show_default();
}

void add_image_size(CommandLine& line, std::uint32_t& width_px, std::uint32_t& height_px) {
  line.option("--width", width_px, "Image width, px").show_default();
  line.option("--height", height_px, "Image height, px").show_default();
}

}  // namespace emit::tool
