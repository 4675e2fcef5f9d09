// SPDX-License-Identifier: Apache-2.0
#include "tool/truth/view_plan.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/constants.hpp"
#include "emit/scene/trajectory.hpp"

namespace emit::tool {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

Result<SolveCamera> parse_camera(const std::string& text) {
  const auto fail = [&](const char* what) {
    return make_error(
        ErrorCode::invalid_argument,
        fmt::format("'{}': {}; a camera is NAME=x,y,z,to_x,to_y,to_z[,fov_deg]", text, what));
  };
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0) return fail("it has no name");
  SolveCamera camera;
  camera.name = text.substr(0, equals);
  if (camera.name.find('/') != std::string::npos) return fail("the name holds a slash");
  std::vector<double> values;
  const char* at = text.data() + equals + 1;
  const char* const end = text.data() + text.size();
  while (at <= end) {
    double value = 0.0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc() || !std::isfinite(value)) return fail("not a number");
    values.push_back(value);
    if (next == end) break;
    if (*next != ',') return fail("not a number");
    at = next + 1;
  }
  if (values.size() != 6 && values.size() != 7) return fail("it needs six or seven numbers");
  camera.position_m = {values[0], values[1], values[2]};
  camera.look_at_m = {values[3], values[4], values[5]};
  if (camera.position_m == camera.look_at_m) return fail("it looks at its own place");
  if (values.size() == 7) {
    if (!(values[6] > 0.0 && values[6] < 180.0)) return fail("the field of view is not 0..180");
    camera.fov_h_rad = values[6] * physics::kDegree;
  }
  return camera;
}

Result<reference::SolveView> view_of(const SolveCamera& camera, const scene::ScenarioDesc& scenario,
                                     std::int64_t sim_time_ns) {
  reference::SolveView view;
  view.sim_time_ns = sim_time_ns;
  view.width_px = scenario.sensor.width_px;
  view.height_px = scenario.sensor.height_px;
  view.fov_h_rad = camera.fov_h_rad > 0.0 ? camera.fov_h_rad : scenario.sensor.fov_h_rad;
  if (!camera.name.empty()) {
    view.sensor_pose = {camera.position_m,
                        physics::world_from_body_look_at(camera.position_m, camera.look_at_m)};
    return view;
  }
  if (scenario.sensor.trajectory.empty()) {
    return make_error(ErrorCode::config, "the scenario's sensor has no position");
  }
  view.sensor_pose = scene::trajectory_at(scenario.sensor.trajectory, sim_time_ns).pose;
  return view;
}

std::filesystem::path camera_pattern(const std::filesystem::path& pattern,
                                     const std::string& camera, bool several) {
  constexpr std::string_view kPlace = "{camera}";
  std::string name = pattern.filename().string();
  if (const std::size_t at = name.find(kPlace); at != std::string::npos) {
    name.replace(at, kPlace.size(), camera.empty() ? "sensor" : camera);
  } else if (several) {
    name = fmt::format("{}_{}{}", pattern.stem().string(), camera, pattern.extension().string());
  }
  return pattern.parent_path() / name;
}

}  // namespace emit::tool
