// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/renderer/renderer.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

/// A radiance picture in the band of a study, row-major.
struct StudyPicture {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::vector<float> radiance_w_m2_sr;
};

/// Renders pictures of one camera, all after one warm-up. Setup only. Errors: those of the
/// renderer; io (interrupted).
/// @param sim_times_ns  ascending, not empty
[[nodiscard]] physics::Result<std::vector<StudyPicture>> render_pictures(
    scene::ScenarioDesc scenario, std::size_t band, const physics::Pose& camera,
    const std::vector<std::int64_t>& sim_times_ns);

/// Renders one picture without any shadow: the surface has seen the weather and nothing else.
/// Errors: those of render_pictures().
[[nodiscard]] physics::Result<StudyPicture> render_unshadowed(scene::ScenarioDesc scenario,
                                                              std::size_t band,
                                                              const physics::Pose& camera,
                                                              std::int64_t sim_time_ns);

/// Returns the visible share of the sun's disc at the surface of every pixel, by rays; 1 for sky.
/// Errors: those of scene::load_scene() and reference::RayScene.
[[nodiscard]] physics::Result<std::vector<double>> sun_shares(const scene::ScenarioDesc& scenario,
                                                              const physics::Pose& camera,
                                                              std::int64_t sim_time_ns);

/// Writes an array of float32 as numpy's .npy, version 1.0. Errors: io.
[[nodiscard]] physics::Result<void> write_npy(const std::filesystem::path& file,
                                              const StudyPicture& picture);

}  // namespace emit::tool
