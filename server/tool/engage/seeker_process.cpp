// SPDX-License-Identifier: Apache-2.0
#include "tool/engage/seeker_process.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <glm/gtc/quaternion.hpp>
#include <iterator>
#include <utility>
#include <vector>

#include "emit/physics/constants.hpp"
#include "tool/engage/json_line.hpp"
#include "tool/engage/python_program.hpp"

namespace emit::tool {

using physics::ErrorCode;
using physics::make_error;

physics::Result<SeekerAnswer> parse_answer(const std::string& line) {
  const auto object = JsonLine::parse(line);
  if (!object) return tl::unexpected(object.error());
  SeekerAnswer out;
  const auto read = [&object](const std::string& key, double& target) -> physics::Result<void> {
    const auto value = object->number(key);
    if (!value) return tl::unexpected(value.error());
    target = *value;
    return {};
  };
  const auto read_count = [&read](const std::string& key,
                                  std::uint64_t& target) -> physics::Result<void> {
    double value = 0.0;
    if (auto done = read(key, value); !done) return done;
    constexpr double kMostExact = 9007199254740992.0;  // 2^53
    if (value < 0.0 || value > kMostExact || value != std::floor(value)) {
      return make_error(ErrorCode::protocol, fmt::format("'{}' is {}, no count", key, value));
    }
    target = static_cast<std::uint64_t>(value);
    return {};
  };
  if (auto done = read_count("frame_number", out.frame_number); !done) {
    return tl::unexpected(done.error());
  }
  if (auto done = read_count("host_frame_number", out.host_frame_number); !done) {
    return tl::unexpected(done.error());
  }
  const auto found = object->boolean("found");
  if (!found) return tl::unexpected(found.error());
  out.found = *found;
  if (!out.found) return out;
  const std::pair<const char*, double*> fields[] = {{"x_px", &out.x_px},
                                                    {"y_px", &out.y_px},
                                                    {"azimuth_rad", &out.azimuth_rad},
                                                    {"elevation_rad", &out.elevation_rad},
                                                    {"quality", &out.quality}};
  for (const auto& [key, target] : fields) {
    if (auto done = read(key, *target); !done) return tl::unexpected(done.error());
  }
  if (std::abs(out.azimuth_rad) > physics::kPi || std::abs(out.elevation_rad) > physics::kPi / 2) {
    return make_error(ErrorCode::protocol, "an angle is more than half a turn");
  }
  return out;
}

glm::dvec3 direction_of(const SeekerAnswer& answer, const physics::Pose& sensor) {
  const double level = std::cos(answer.elevation_rad);
  const glm::dvec3 body{level * std::cos(answer.azimuth_rad), level * std::sin(answer.azimuth_rad),
                        -std::sin(answer.elevation_rad)};
  return glm::normalize(sensor.world_from_body * body);
}

physics::Result<SeekerProcess> SeekerProcess::start(const Options& options,
                                                    std::chrono::milliseconds timeout) {
  std::vector<std::string> wishes{"--url",      options.url,
                                  "--channel",  options.channel,
                                  "--focal-px", fmt::format("{:.17g}", options.focal_px),
                                  "--method",   options.method};
  if (options.newest) wishes.emplace_back("--newest");
  std::vector<std::string> arguments;
  if (options.command.empty()) {
    auto program = python_program("emit_client.seeker");
    if (!program) return tl::unexpected(program.error());
    arguments = std::move(*program);
  } else {
    arguments = {"/bin/sh", "-c", options.command + " \"$@\"", "seeker"};
  }
  arguments.insert(arguments.end(), wishes.begin(), wishes.end());
  auto lines = LinePipe::open();
  if (!lines) return tl::unexpected(lines.error());
  auto process = Subprocess::start(arguments, options.log, lines->write_end());
  if (!process) return tl::unexpected(process.error());
  lines->close_write_end();
  SeekerProcess out(std::move(*process), std::move(*lines), options.log);
  const auto line = out.lines_.next(timeout);
  if (!line) return tl::unexpected(out.with_log(line.error()));
  if (!*line) {
    return make_error(ErrorCode::io,
                      fmt::format("the seeker was not ready within {} s", timeout.count() / 1000));
  }
  const auto object = JsonLine::parse(**line);
  if (!object) return tl::unexpected(physics::Error(object.error()).with_context("seeker"));
  if (const auto ready = object->boolean("ready"); !ready || !*ready) {
    return make_error(ErrorCode::protocol,
                      "seeker: the first line must be {\"ready\": true}, not " + **line);
  }
  return out;
}

physics::Result<std::optional<SeekerAnswer>> SeekerProcess::next(
    std::chrono::milliseconds timeout) {
  const auto line = lines_.next(timeout);
  if (!line) return tl::unexpected(with_log(line.error()));
  if (!*line) return std::optional<SeekerAnswer>();
  auto answer = parse_answer(**line);
  if (!answer) return tl::unexpected(std::move(answer.error()).with_context("seeker"));
  return std::optional<SeekerAnswer>(*answer);
}

physics::Error SeekerProcess::with_log(physics::Error error) const {
  std::ifstream file(log_);
  std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  constexpr std::size_t kShownBytes = 2000;
  if (text.size() > kShownBytes) text.erase(0, text.size() - kShownBytes);
  error.text = fmt::format("seeker: {}{}{}", error.text, text.empty() ? "" : ":\n", text);
  return error;
}

}  // namespace emit::tool
