// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/renderer/renderer.hpp"
#include "emit/scene/scene_desc.hpp"
#include "pacing/quality_policy.hpp"

namespace emit::tool {

/// Result of a frame, from submit() until its pixels are in memory.
struct TimedFrame {
  double frame_ms = 0.0;
  bool coarse = false;  ///< renderer::FrameStats::coarse has a reason
  std::uint8_t quality_level = 0;
};

/// A renderer on a thread of its own, so that several renderers, each with its own GL context,
/// exist at once and render in turn. Calls block until the thread has done them, so at most one
/// renderer works at a time when one thread calls. Setup class; the frames themselves are those of
/// Renderer.
class RendererThread {
 public:
  /// Creates the renderer. With `temperature` frames carry that channel. Errors: those of
  /// Renderer::create().
  [[nodiscard]] static physics::Result<std::unique_ptr<RendererThread>> create(
      const scene::ScenarioDesc& scenario, int gpu_index,
      renderer::Ladder ladder = renderer::Ladder::none, bool temperature = false);
  ~RendererThread();
  RendererThread(const RendererThread&) = delete;
  RendererThread& operator=(const RendererThread&) = delete;

  /// Calls Renderer::warm_up() and returns the seconds it took. An interrupt ends it with an error
  /// (io).
  [[nodiscard]] physics::Result<double> warm_up(const renderer::FrameRequest& first);
  /// Renders a frame. `temperature_k`, unless null, gets the temperatures; copying them is not
  /// timed. Errors: io (interrupted), gpu (the device failed), internal.
  [[nodiscard]] physics::Result<TimedFrame> render(const renderer::FrameRequest& request,
                                                   std::vector<float>* temperature_k = nullptr);
  /// Renders a frame within a deadline as the daemon does: server::QualityPolicy chooses the
  /// quality level, and its time is included.
  [[nodiscard]] physics::Result<TimedFrame> render_within(renderer::FrameRequest request,
                                                          double budget_ms);

  /// Calls Renderer::apply_entities().
  void apply_entities(std::int64_t sim_time_ns, std::span<const renderer::EntityUpdate> updates);
  /// Calls Renderer::apply_weather().
  void apply_weather(const scene::WeatherSample& sample);

  [[nodiscard]] physics::Pose scenario_pose_at(std::int64_t sim_time_ns) const noexcept {
    return renderer_->scenario_sensor_pose_at(sim_time_ns);
  }
  [[nodiscard]] const renderer::SceneStats& stats() const noexcept {
    return renderer_->scene_stats();
  }
  [[nodiscard]] const std::string& device() const noexcept { return renderer_->device_name(); }

 private:
  RendererThread();
  /// Runs `job` on the thread and waits for its end.
  void call(const std::function<void()>& job);
  [[nodiscard]] physics::Result<TimedFrame> timed(
      const std::function<int(std::chrono::steady_clock::time_point start)>& submit,
      std::vector<float>* temperature_k = nullptr);
  void loop();

  std::mutex mutex_;
  std::condition_variable changed_;
  const std::function<void()>* job_ = nullptr;
  bool ends_ = false;
  server::QualityPolicy policy_;
  std::unique_ptr<renderer::Renderer> renderer_;  ///< made, used and destroyed on the thread
  std::thread thread_;
};

}  // namespace emit::tool
