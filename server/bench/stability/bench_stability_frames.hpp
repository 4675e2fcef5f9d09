// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::tool {

/// Options of a run of whole frames under hostile scenes, through the renderer's public interface.
/// The run covers geometry, obscurance, soft shadows, thermal history and radiance together.
struct HostileFrameOptions {
  std::uint32_t width_px = 160;
  std::uint32_t height_px = 128;
  int gpu_index = -1;
  std::vector<std::string> only;      ///< names of tests; empty: all
  std::filesystem::path picture_dir;  ///< every frame's temperature as PNG; empty: none
  /// Called with the share done, 0..1. It returns false to stop with an error.
  std::function<bool(double)> progress;
};

/// Result of a test over all its frames. An error is the distance to the temperature that the
/// test's note names. It is NaN where no temperature is judged.
struct HostileFrameResult {
  std::string test;
  std::string device;
  std::uint64_t frames = 0;
  std::uint64_t cases = 0;      ///< pixels judged
  std::uint64_t nan_count = 0;  ///< radiance values, and temperatures of surfaces
  std::uint64_t inf_count = 0;
  std::uint64_t nonfinite_px = 0;  ///< counted by the renderer, which writes 0 there
  std::uint64_t clamped_count = 0;
  double max_error_k = 0.0;
  double p99_error_k = 0.0;
  std::string worst_input;
  std::string note;
};

[[nodiscard]] std::vector<std::string> hostile_frame_tests();

/// Runs the tests. Errors: gpu, io, invalid_argument for a test that does not exist.
[[nodiscard]] physics::Result<std::vector<HostileFrameResult>> run_hostile_frames(
    const HostileFrameOptions& options);

}  // namespace emit::tool
