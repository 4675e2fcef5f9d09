// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/reference/solve.hpp"
#include "emit/scene/scene_desc.hpp"

/// Tables of `emit solve --at`: points of the world in, temperatures out.
namespace emit::tool {

/// Reads a CSV table with the columns x_m, y_m, z_m and optionally nx, ny, nz (a normal out of the
/// body) and object (the name of an object), in any order. An empty normal or name counts as not
/// given. Lines that begin with # are comments. Errors: not_found, io, parse (the message names
/// file and line), config (no object has the name).
[[nodiscard]] physics::Result<std::vector<reference::SolveProbe>> read_probes(
    const std::filesystem::path& file, const scene::ScenarioDesc& scenario);

/// Returns the header of the table of results.
[[nodiscard]] std::string probe_header();
/// Returns one line per probe: time, place on the surface, normal, object and temperature in K. A
/// probe without a surface has its own place, empty columns and nan.
[[nodiscard]] std::string probe_rows(double time_s, std::span<const reference::SolveProbe> probes,
                                     std::span<const reference::ProbedPoint> points,
                                     const scene::ScenarioDesc& scenario);

}  // namespace emit::tool
