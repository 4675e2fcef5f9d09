// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

/// Content of a preview sheet: four views, up to two bands, some times.
struct PreviewPlan {
  std::vector<double> times_s;     ///< ascending, not empty
  std::vector<std::size_t> bands;  ///< indices into the scenario's bands, not empty
  std::string focus;               ///< object in the middle; empty: all but flat ones
  std::uint32_t width_px = 320;    ///< of one picture
  std::uint32_t height_px = 256;
  int gpu_index = -1;
};

/// Renders the sheet and writes it as PNG: a row for each view (front left, rear right, side,
/// above), a column for each band and time. Pictures of a band share the limits of their colours,
/// which the head of the column states. Errors: those of the renderer and of write_png();
/// invalid_argument (no such object).
[[nodiscard]] physics::Result<void> write_preview_sheet(scene::ScenarioDesc scenario,
                                                        const PreviewPlan& plan,
                                                        const std::filesystem::path& file);

}  // namespace emit::tool
