// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/reference/solve.hpp"
#include "emit/scene/scene_desc.hpp"

/// Views of `emit solve`: the scenario's sensor, or cameras of the command line.
namespace emit::tool {

/// Camera of the command line.
struct SolveCamera {
  std::string name;  ///< empty for the scenario's sensor
  glm::dvec3 position_m{0.0};
  glm::dvec3 look_at_m{0.0};
  double fov_h_rad = 0.0;  ///< 0: that of the scenario's sensor
};

/// Reads NAME=x,y,z,to_x,to_y,to_z[,fov_deg]. Errors: invalid_argument, quoting the text.
[[nodiscard]] physics::Result<SolveCamera> parse_camera(const std::string& text);

/// Returns the view of a camera at an instant; that of the scenario's sensor for a camera without a
/// name. Errors: config (the sensor has no position).
[[nodiscard]] physics::Result<reference::SolveView> view_of(const SolveCamera& camera,
                                                            const scene::ScenarioDesc& scenario,
                                                            std::int64_t sim_time_ns);

/// Returns the pattern of file names of a camera: {camera} stands for its name; without it, several
/// cameras add _<name> before the extension.
[[nodiscard]] std::filesystem::path camera_pattern(const std::filesystem::path& pattern,
                                                   const std::string& camera, bool several);

}  // namespace emit::tool
