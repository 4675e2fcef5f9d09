// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "bench/accuracy/bench_rules.hpp"
#include "bench/frame_time/paper_errors.hpp"
#include "emit/physics/error.hpp"
#include "emit/reference/solve.hpp"
#include "emit/scene/scene_desc.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {

/// Horizontal motion of the image's centre per frame, px. It is larger elsewhere in the image.
inline constexpr double kPaperPanPx = 2.5;
/// Closings of the newest history interval that a run crosses.
inline constexpr double kPaperClosings = 3.2;

/// A method of the thermal simulation as `emit bench paper` runs it.
struct PaperMethod {
  scene::ThermalMethod method = scene::ThermalMethod::per_frame;
  const char* name = "per-frame";
  std::uint32_t least_frames = 5;
  /// False: the content of a frame does not depend on the frames before it.
  bool carries_state = false;
};
inline constexpr std::array kPaperMethods{
    PaperMethod{}, PaperMethod{scene::ThermalMethod::cached, "cached", 300, true}};

/// Size and number of the frames of a run, and the device that renders them.
struct PaperFrames {
  std::uint32_t width_px = 1024;
  std::uint32_t height_px = 768;
  std::uint32_t frames = 5;  ///< at least; PaperMethod::least_frames may ask for more
  int gpu_index = -1;        ///< EGL device; -1: the first hardware device, else Mesa
};

/// Frames of one scene, method and number of steps: a camera that pans to and fro and a clock that
/// goes on.
struct PaperRun {
  scene::ScenarioDesc scenario;
  PaperMethod method;
  std::int64_t start_ns = 0;
  std::int64_t advance_ns = 0;
  std::uint32_t frames = 0;
  int gpu_index = -1;
};
[[nodiscard]] PaperRun make_paper_run(scene::ScenarioDesc scenario, const PaperMethod& method,
                                      std::uint32_t steps, const PaperFrames& frames);

struct PaperTimes {
  Samples frame_ms;
  std::array<Samples, 6> stages_ms;
  std::string device;
  std::uint64_t triangles = 0;
};

/// Called after every frame.
using PaperProgress = std::function<void()>;

/// Times one pass over the frames of a run after a warm-up frame. With `stages` the renderer waits
/// for the device after each stage, so that stages are timed apart. Errors: gpu, io (interrupted),
/// those of Renderer::create().
[[nodiscard]] physics::Result<PaperTimes> time_frames(const PaperRun& run, bool stages,
                                                      const PaperProgress& progress);

/// Measures the shares of the image over the run's first frame and the frame after half a pan.
/// These frames are not timed, so that the channels they need cost the measured frames nothing.
[[nodiscard]] physics::Result<SceneFill> check_fill(const PaperRun& run);

/// Returns the temperatures of the run's first and last frame, which are not timed either. A method
/// that carries state renders every frame in between as well.
[[nodiscard]] physics::Result<std::vector<JudgedFrame>> judged_frames(const PaperRun& run);

/// Returns the view of the first frame.
[[nodiscard]] physics::Result<reference::SolveView> first_view(const PaperRun& run);

}  // namespace emit::tool
