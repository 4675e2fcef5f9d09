// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "emit/scene/scene_desc.hpp"

namespace emit::renderer {

/// Returns what the scenario lacks for a first frame at that simulation time, one sentence each:
/// weather up to the frame, and a thermal history before it.
/// Thread: any.  Real time: setup only.
[[nodiscard]] std::vector<std::string> first_frame_warnings(const scene::ScenarioDesc& scenario,
                                                            std::int64_t thermal_time_ns);

}  // namespace emit::renderer
