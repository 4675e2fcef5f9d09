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
#include "tool/view/pixel_report.hpp"
#include "tool/view/time_bar.hpp"
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
    if (!control.report_px) control_.report_px = pending.report_px;
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
  std::optional<double> solar_hour(std::int64_t sim_time_ns) const override {
    return view::solar_hour(scenario_.epoch_utc_ns, sim_time_ns, scenario_.place.lon_rad);
  }
  std::optional<double> travelled_frac() const override {
    const double done_frac = travelled_frac_.load();
    if (done_frac < 0.0) return std::nullopt;
    return done_frac;
  }

 private:
  void run(std::promise<physics::Result<void>>& made) {
    renderer::OutputOptions output;
    output.temperature = output.depth = output.object = output.sun = output.sky = true;
    output.coverage = output.terms = true;
    output.ladder = renderer::Ladder::replayed;
    output.slots = 2;
    auto created = renderer::Renderer::create(scenario_, {gpu_index_, false}, output);
    if (!created) {
      made.set_value(tl::unexpected(created.error()));
      return;
    }
    made.set_value({});
    auto finder = std::async(std::launch::async, [this] { return ProbeFinder::create(scenario_); });
    if (auto ready = warm_up(**created); !ready) {
      slot_.end(ready.error().text, true);
      return;
    }
    auto found = finder.get();
    if (!found) {
      slot_.end(found.error().text, true);
      return;
    }
    finder_.emplace(std::move(*found));
    std::vector<std::string> names;
    for (const scene::Material& material : finder_->materials()) names.push_back(material.name);
    material_names_ = std::make_shared<const std::vector<std::string>>(std::move(names));
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

  /// Brings the surface to the simulated time after a jump. It may take as long as a warm-up.
  physics::Result<void> travel(renderer::Renderer& renderer, double jump_s) {
    renderer::FrameRequest to;
    to.sim_time_ns = to.thermal_time_ns = std::llround(sim_time_s_ * 1e9);
    to.sensor_pose = renderer.scenario_sensor_pose_at(to.sim_time_ns);
    const auto progress = [&](double done_frac) {
      travelled_frac_.store(done_frac);
      return !stop_.load();
    };
    travelled_frac_.store(0.0);
    auto done = jump_s > 0.0 ? renderer.carry_on(to, progress) : renderer.warm_up(to, progress);
    travelled_frac_.store(-1.0);
    return done;
  }

  /// Finds the pixels that show the place of a thermal sample.
  void find_samples(const renderer::Renderer& renderer, const renderer::FrameView& view,
                    std::vector<std::uint32_t>& px) const {
    const physics::Pose& sensor = view.sensor_pose;
    const glm::dquat body_from_world = glm::conjugate(sensor.world_from_body);
    const double px_per_tan = 0.5 * view.width_px / std::tan(0.5 * view.fov_h_rad);
    const auto samples = static_cast<std::uint32_t>(renderer.scene_stats().samples);
    for (std::uint32_t s = 0; s < samples; ++s) {
      const glm::dvec3 body =
          body_from_world * (renderer.sample_reading(s).position_world_m - sensor.position_world_m);
      if (!(body.x > 0.0)) continue;
      const double x = body.y / body.x * px_per_tan + 0.5 * view.width_px;
      const double y = body.z / body.x * px_per_tan + 0.5 * view.height_px;
      if (!(x >= 0.0 && y >= 0.0 && x < view.width_px && y < view.height_px)) continue;
      const auto at = static_cast<std::uint32_t>(y) * view.width_px + static_cast<std::uint32_t>(x);
      // A sample behind what the pixel shows is hidden.
      constexpr double kBehindFrac = 0.01;
      constexpr double kBehindM = 0.01;
      if (body.x <= (1.0 + kBehindFrac) * static_cast<double>(view.depth_m[at]) + kBehindM) {
        px.push_back(at);
      }
    }
    std::ranges::sort(px);
    const auto [first, last] = std::ranges::unique(px);
    px.erase(first, last);
  }

  void fill_frame(const renderer::Renderer& renderer, const renderer::FrameView& view,
                  const ViewControl& control, ViewFrame& frame) {
    frame.width_px = view.width_px;
    frame.height_px = view.height_px;
    const auto copy = [](std::span<const float> from, std::vector<float>& to) {
      to.assign(from.begin(), from.end());
    };
    copy(view.radiance_w_m2_sr[band_], frame.radiance_w_m2_sr);
    copy(view.temperature_k, frame.temperature_k);
    copy(view.material, frame.material);
    copy(view.sun_cosine, frame.sun_cosine);
    copy(view.sky_frac, frame.sky_frac);
    frame.apparent_temperature = false;
    frame.frame_number = view.frame_number;
    frame.sim_time_ns = view.sim_time_ns;
    frame.sensor_pose = view.sensor_pose;
    frame.material_names = material_names_;
    frame.quality_level = view.quality_level;
    frame.sample_px.clear();
    if (control.samples) find_samples(renderer, view, frame.sample_px);
    if (control.report_px && control.report_px->x < view.width_px &&
        control.report_px->y < view.height_px) {
      report_ = std::make_shared<const std::vector<std::string>>(
          pixel_report(scenario_, *finder_, renderer, view, band_, *control.report_px));
    }
    frame.report = report_;
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
        control_.report_px.reset();
      }
      const auto now = Clock::now();
      // A slow device skips simulated time, so that it does not fall behind for ever.
      const double wall_s = std::min(1.0, std::chrono::duration<double>(now - last).count());
      last = now;
      if (!control.paused && number > 0) sim_time_s_ += wall_s;
      sim_time_s_ += control.jump_s;
      if (control.jump_s != 0.0) {
        if (auto done = travel(renderer, control.jump_s); !done) {
          slot_.end(done.error().text, true);
          return;
        }
        last = Clock::now();
      }

      renderer::FrameRequest request;
      request.frame_number = ++number;
      request.sim_time_ns = std::llround(sim_time_s_ * 1e9);
      request.thermal_time_ns = request.sim_time_ns;
      const physics::Pose base = renderer.scenario_sensor_pose_at(request.sim_time_ns);
      if (control.home) shift_world_m_ = glm::dvec3(0.0);
      shift_world_m_ += step_world_m(base, control);
      request.sensor_pose = turned_pose(base, control);
      request.sensor_pose.position_world_m += shift_world_m_;
      // The terms of a pixel belong to a frame of full quality.
      request.quality_level = control.report_px ? std::uint8_t{0} : control.quality_level;
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
      fill_frame(renderer, view, control, frame);
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
  std::optional<ProbeFinder> finder_;
  std::shared_ptr<const std::vector<std::string>> material_names_;
  std::shared_ptr<const std::vector<std::string>> report_;
  std::atomic<double> travelled_frac_{-1.0};  ///< of a jump in time; below 0: there is none
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
