// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"
#include "tool/support/renderer_thread.hpp"
#include "tool/support/statistics.hpp"

/// Frame times of scenes that are shown in turn, so that drifts of the machine affect them alike.
namespace emit::tool {

/// A renderer that shows a scenario from the pose of its camera at the start of the frame, while
/// sim time goes on. Setup class.
class SceneRunner {
 public:
  /// Frame rate in sim time: each frame advances it by 1 / kRateHz seconds.
  static constexpr double kRateHz = 200.0;
  /// Number of untimed frames of a renderer before others join.
  static constexpr std::uint32_t kSettleFrames = 3;

  /// Creates a renderer that is warmed up and has shown `settle_frames`. The caller keeps
  /// `scenario` alive. Errors: those of the renderer.
  [[nodiscard]] static physics::Result<SceneRunner> start(const scene::ScenarioDesc& scenario,
                                                          std::uint32_t settle_frames,
                                                          int gpu_index);

  /// Shows the next frame and returns its time.
  [[nodiscard]] physics::Result<double> frame_ms();
  [[nodiscard]] std::uint32_t next_frame() const noexcept { return next_frame_; }
  void skip_to(std::uint32_t frame) noexcept { next_frame_ = frame; }

  [[nodiscard]] const scene::ScenarioDesc& scenario() const noexcept { return *scenario_; }
  [[nodiscard]] const renderer::SceneStats& stats() const noexcept { return renderer_->stats(); }
  [[nodiscard]] const std::string& device() const noexcept { return renderer_->device(); }
  /// Time to load and simplify the scene; then the time to prepare the thermal state.
  [[nodiscard]] double setup_s() const noexcept { return setup_s_; }
  [[nodiscard]] double warm_up_s() const noexcept { return warm_up_s_; }

 private:
  SceneRunner(const scene::ScenarioDesc& scenario, std::unique_ptr<RendererThread> renderer)
      : scenario_(&scenario), renderer_(std::move(renderer)) {}
  [[nodiscard]] renderer::FrameRequest request(std::uint32_t frame) const;

  const scene::ScenarioDesc* scenario_;
  std::unique_ptr<RendererThread> renderer_;
  double setup_s_ = 0.0;
  double warm_up_s_ = 0.0;
  std::uint32_t next_frame_ = 0;
};

/// Frame times of a, its twin and b, which take turns. The order changes from round to round.
using Rounds = std::array<std::vector<double>, 3>;
[[nodiscard]] physics::Result<Rounds> take_turns(std::array<SceneRunner*, 3> runners,
                                                 std::uint32_t rounds);

/// Ratio of frame times of three renderers in turn: a, its twin of the same scene, and b.
struct PairedRatio {
  std::size_t pairs = 0;
  double ratio = 0.0;  ///< median of b / a
  double self_ratio = 0.0;
  /// Largest distance from 1 of the medians of thirds of the pairs of a and its twin.
  double self_spread = 0.0;

  /// Returns true when the ratio is at most `limit_ratio`, or no farther above 1 than the self
  /// spread.
  [[nodiscard]] bool within(double limit_ratio) const noexcept;
};
/// Computes the ratio of b to a, and the spread of a against its twin.
/// @pre the three have the same number of frames, at least 3; all times > 0
[[nodiscard]] PairedRatio paired_ratio(std::span<const double> a_ms,
                                       std::span<const double> twin_ms,
                                       std::span<const double> b_ms);

/// A scene that has something in addition to another one.
struct SceneVariant {
  std::string name;
  scene::ScenarioDesc scenario;
};
/// Frame times of a variant beside the scene that it adds to.
struct VariantTimes {
  Samples frame_ms;
  PairedRatio pairs;
  double warm_up_s = 0.0;
};
/// Times of the plain scene, then of each variant.
struct VariantResult {
  std::string device;
  std::vector<VariantTimes> times;
};
struct VariantOptions {
  const char* label = "";  ///< of the progress
  double time_s = 0.0;     ///< simulation time of the first frame
  std::uint32_t pairs = 45;
  int gpu_index = -1;
};
/// Shows the plain scene, its twin and each variant in turn. Errors: those of the renderer.
[[nodiscard]] physics::Result<VariantResult> compare_variants(
    const scene::ScenarioDesc& plain, std::span<const SceneVariant> variants,
    const VariantOptions& options);

}  // namespace emit::tool
