// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <future>
#include <optional>
#include <thread>

#include "emit/renderer/renderer.hpp"
#include "tool/support/console.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/view/frame_provider.hpp"
#include "tool/view/view_control.hpp"

namespace emit::tool::view {
namespace {

using Clock = std::chrono::steady_clock;

class ScenarioProvider final : public FrameProvider {
 public:
  ScenarioProvider(scene::ScenarioDesc scenario, std::size_t band, double start_s, int gpu_index)
      : scenario_(std::move(scenario)), band_(band), sim_time_s_(start_s), gpu_index_(gpu_index) {}

  /// Starts the thread that owns the renderer's context. The context is made there, and its failure
  /// is returned here.
  physics::Result<void> start() {
    std::promise<physics::Result<void>> made;
    auto result = made.get_future();
    thread_ = std::thread([this, promise = std::move(made)]() mutable { run(promise); });
    return result.get();
  }
  ~ScenarioProvider() override {
    stop_.store(true);
    if (thread_.joinable()) thread_.join();
  }

  bool take(ViewFrame& frame) override { return slot_.take(frame); }
  void control(const ViewControl& control) override {
    const std::lock_guard lock(control_mutex_);
    // Steps and jumps that the loop has not seen yet stay. Going home cancels the steps before it.
    const ViewControl pending = control_;
    control_ = control;
    control_.jump_s += pending.jump_s;
    control_.home = control.home || pending.home;
    if (!control.home) {
      control_.forward_m += pending.forward_m;
      control_.right_m += pending.right_m;
      control_.up_m += pending.up_m;
    }
  }
  std::optional<ViewEnd> ended() override { return slot_.ended(); }
  std::string title() const override { return scenario_.name; }
  std::string band() const override { return scenario_.bands[band_].name; }
  void limits(double& min_k, double& max_k) const override {
    min_k = scenario_.display.min_k;
    max_k = scenario_.display.max_k;
  }

 private:
  void run(std::promise<physics::Result<void>>& made) {
    renderer::OutputOptions output;
    output.temperature = true;
    output.slots = 2;
    auto created = renderer::Renderer::create(scenario_, {gpu_index_, false}, output);
    if (!created) {
      made.set_value(tl::unexpected(created.error()));
      return;
    }
    made.set_value({});
    if (auto ready = warm_up(**created); !ready) {
      slot_.end(ready.error().text, true);
      return;
    }
    loop(**created);
  }

  physics::Result<void> warm_up(renderer::Renderer& renderer) {
    for (const std::string& text : renderer.scene_stats().warnings) warn(text);
    renderer::FrameRequest first;
    first.sim_time_ns = first.thermal_time_ns = std::llround(sim_time_s_ * 1e9);
    first.sensor_pose = renderer.scenario_sensor_pose_at(first.sim_time_ns);
    Progress bar("warm-up", 1000);
    auto ready = renderer.warm_up(first, [&](double done_frac) {
      bar.advance_to(static_cast<std::uint64_t>(1000.0 * done_frac));
      return !stop_.load();
    });
    bar.finish();
    for (const std::string& text : renderer::warm_up_warnings(renderer.scene_stats())) warn(text);
    return ready;
  }

  void loop(renderer::Renderer& renderer) {
    ViewFrame frame;
    std::uint64_t number = 0;
    auto last = Clock::now();
    while (!stop_.load()) {
      ViewControl control;
      {
        const std::lock_guard lock(control_mutex_);
        control = control_;
        control_.jump_s = control_.forward_m = control_.right_m = control_.up_m = 0.0;
        control_.home = false;
      }
      const auto now = Clock::now();
      // A slow device skips simulated time, so that it does not fall behind for ever.
      const double wall_s = std::min(1.0, std::chrono::duration<double>(now - last).count());
      last = now;
      if (!control.paused && number > 0) sim_time_s_ += wall_s;
      sim_time_s_ += control.jump_s;

      renderer::FrameRequest request;
      request.frame_number = ++number;
      request.sim_time_ns = std::llround(sim_time_s_ * 1e9);
      request.thermal_time_ns = request.sim_time_ns;
      const physics::Pose base = renderer.scenario_sensor_pose_at(request.sim_time_ns);
      if (control.home) shift_world_m_ = glm::dvec3(0.0);
      shift_world_m_ += step_world_m(base, control);
      request.sensor_pose = turned_pose(base, control);
      request.sensor_pose.position_world_m += shift_world_m_;
      const int slot = renderer.submit(request);
      if (slot < 0) {
        slot_.end("the renderer has no free slot", true);
        return;
      }
      const auto& view = renderer.collect(static_cast<renderer::SlotIndex>(slot));
      if (view.device_failed) {
        renderer.release(static_cast<renderer::SlotIndex>(slot));
        slot_.end("the device reported an error", true);
        return;
      }
      frame.width_px = view.width_px;
      frame.height_px = view.height_px;
      const auto radiance = view.radiance_w_m2_sr[band_];
      frame.radiance_w_m2_sr.assign(radiance.begin(), radiance.end());
      frame.temperature_k.assign(view.temperature_k.begin(), view.temperature_k.end());
      frame.apparent_temperature = false;
      frame.frame_number = number;
      frame.sim_time_ns = request.sim_time_ns;
      renderer.release(static_cast<renderer::SlotIndex>(slot));
      frame.frame_ms = std::chrono::duration<double, std::milli>(Clock::now() - now).count();
      slot_.put(frame);
      constexpr auto kFramePeriod = std::chrono::milliseconds(10);
      if (Clock::now() - now < kFramePeriod) std::this_thread::sleep_until(now + kFramePeriod);
    }
  }

  scene::ScenarioDesc scenario_;
  std::size_t band_;
  double sim_time_s_;
  glm::dvec3 shift_world_m_{0.0};  ///< where the user moved the camera
  int gpu_index_;
  FrameSlot slot_;
  std::mutex control_mutex_;
  ViewControl control_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace

physics::Result<std::unique_ptr<FrameProvider>> make_scenario_provider(
    const SourceOptions& options) {
  auto scenario = load_scenario_choice({options.source, options.set});
  if (!scenario) {
    return physics::make_error(physics::ErrorCode::config, std::move(scenario.error().text));
  }
  const auto band = find_band(*scenario, options.band);
  if (!band) return tl::unexpected(band.error());
  const double start_s =
      options.time_s.value_or(1e-9 * static_cast<double>(trajectory_start_ns(*scenario)));
  auto provider =
      std::make_unique<ScenarioProvider>(std::move(*scenario), *band, start_s, options.gpu_index);
  if (auto started = provider->start(); !started) return tl::unexpected(started.error());
  return std::unique_ptr<FrameProvider>(std::move(provider));
}

}  // namespace emit::tool::view
