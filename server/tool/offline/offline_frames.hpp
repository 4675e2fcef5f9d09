// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/renderer/renderer.hpp"
#include "emit/scene/scene_desc.hpp"
#include "tool/support/progress.hpp"

/// Frames without a daemon: commands render a scenario at instants of their choice.
namespace emit::tool {

/// Whether the user hears what a scenario lacks.
enum class SceneWarnings : std::uint8_t {
  told,   ///< as warnings
  known,  ///< it has been told for the same scenario
};

/// One frame of a plan.
struct OfflineShot {
  std::int64_t sim_time_ns = 0;
  physics::Pose sensor_pose;
  double fov_h_rad = 0.0;      ///< 0: that of the scenario
  scene::PixelRect window_px;  ///< part of the image that is needed; empty: all of it
  bool jump = false;  ///< the camera is not on its way from the shot before, but a view of its own
};

/// Frames of a scenario at ascending instants, with one warm-up: the state of the surface goes on
/// from shot to shot. Surfaces are refined for the cameras of the plan alone, unless the scenario
/// shares its state in a file. Thread: one. Real time: setup only.
class OfflineFrames {
 public:
  /// Creates the renderer, and brings the surface to the first shot. `shots` ascend in time and are
  /// all that will be rendered. Errors: those of Renderer::create() and warm_up().
  /// @pre `shots` is not empty.
  [[nodiscard]] static physics::Result<std::unique_ptr<OfflineFrames>> create(
      scene::ScenarioDesc scenario, std::span<const OfflineShot> shots,
      const renderer::OutputOptions& output, int gpu_index,
      SceneWarnings warnings = SceneWarnings::told);

  /// Renders the next shot of the plan. The frame is valid until the next call. Errors: those of
  /// Renderer::carry_on(), gpu (the device reported an error), internal (interrupted).
  /// @pre not all shots are rendered
  [[nodiscard]] physics::Result<const renderer::FrameView*> next();

  /// Takes the bar away before the caller writes lines.
  void clear_bar() { bar_.clear(); }
  [[nodiscard]] const renderer::Renderer& renderer() const noexcept { return *renderer_; }
  [[nodiscard]] double setup_ms() const noexcept { return setup_ms_; }
  [[nodiscard]] double warm_up_ms() const noexcept { return warm_up_ms_; }
  [[nodiscard]] double frame_ms() const noexcept { return frame_ms_; }  ///< of the latest frame

 private:
  explicit OfflineFrames(std::span<const OfflineShot> shots);
  [[nodiscard]] renderer::FrameRequest request(std::size_t index) const;
  void release();

  std::vector<OfflineShot> shots_;
  std::unique_ptr<renderer::Renderer> renderer_;
  Progress bar_;
  std::size_t next_ = 0;
  int slot_ = -1;
  double setup_ms_ = 0.0;
  double warm_up_ms_ = 0.0;
  double frame_ms_ = 0.0;
};

/// Returns shots of the scenario's own sensor at these times (s, ascending).
[[nodiscard]] std::vector<OfflineShot> sensor_shots(const scene::ScenarioDesc& scenario,
                                                    std::span<const double> times_s);

}  // namespace emit::tool
