// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "agents/frame_source.hpp"
#include "agents/messages.hpp"

namespace emit::test {

/// Calls that a source received, kept by the test so that they outlive the source.
struct SourceScript {
  bool ready = true;                       ///< poll(): false holds frames back
  bool weather_full = false;               ///< apply_weather(): no room
  std::uint64_t dropped_poses = 0;         ///< of every frame's statistics
  renderer::CoarseReasons coarse;          ///< likewise
  renderer::HeatLimits heat_limits;        ///< likewise
  std::uint32_t plain_targets = 0;         ///< likewise
  std::atomic<bool> device_failed{false};  ///< of every frame collected
  std::atomic<bool> device_lost{false};    ///< likewise
  std::vector<renderer::QualityLevelStats> quality_levels{
      renderer::QualityLevelStats{}};  ///< quality ladder
  std::vector<renderer::FrameRequest> submitted;
  std::vector<std::pair<std::int64_t, std::vector<renderer::EntityUpdate>>> entities;
  std::vector<renderer::EntityUpdate> foreseen;  ///< since the last entities were applied
  std::int64_t foreseen_ns = 0;
  std::vector<std::pair<std::int64_t, renderer::PartUpdate>> parts;
  std::vector<scene::WeatherSample> weather;
  std::vector<std::string> order;  ///< kinds of calls, in order
  int resets = 0;
  std::atomic<int> held{0};  ///< slots not released
  /// Called within submit(), for example to let time pass there.
  std::function<void(const renderer::FrameRequest&)> on_submit;
};

/// A renderer without a device: pixels are a function of everything that was handed in so far, so
/// that two runs agree only when they were driven alike.
class ScriptedSource final : public server::FrameSource {
 public:
  ScriptedSource(SourceScript& script, std::uint32_t width_px, std::uint32_t height_px,
                 std::uint32_t slots)
      : script_(script), pixels_(slots), views_(slots) {
    info_.device = "scripted";
    info_.width_px = width_px;
    info_.height_px = height_px;
    info_.slots = slots;
    info_.planes = 1;
    info_.first_time_ns = 0;
    for (auto& pixels : pixels_) {
      pixels.resize(std::size_t{width_px} * height_px);
    }
  }

  std::size_t apply_entities(std::int64_t sim_time_ns,
                             std::span<const renderer::EntityUpdate> updates) noexcept override {
    script_.foreseen.clear();
    if (!updates.empty()) {
      script_.entities.emplace_back(sim_time_ns, std::vector(updates.begin(), updates.end()));
      script_.order.emplace_back("entities");
      for (const auto& update : updates) {
        mix(update.entity_id);
        mix(update.pose.position_world_m.x);
        mix(update.pose.world_from_body.z);
        mix(update.on ? 1.0 : 0.0);
        mix(update.teleport ? 1.0 : 0.0);
      }
      mix(static_cast<double>(sim_time_ns));
    }
    return updates.size();
  }
  void foresee_entities(std::int64_t sim_time_ns,
                        std::span<const renderer::EntityUpdate> updates) noexcept override {
    script_.foreseen_ns = sim_time_ns;
    script_.foreseen.assign(updates.begin(), updates.end());
  }
  bool apply_part(std::int64_t sim_time_ns, const renderer::PartUpdate& update) noexcept override {
    script_.parts.emplace_back(sim_time_ns, update);
    script_.order.emplace_back("part");
    mix(update.entity_id);
    mix(update.part_id);
    mix(static_cast<double>(update.command.kind));
    mix(update.command.value);
    mix(static_cast<double>(sim_time_ns));
    return true;
  }
  bool apply_weather(const scene::WeatherSample& sample) noexcept override {
    if (script_.weather_full) {
      return false;
    }
    script_.weather.push_back(sample);
    script_.order.emplace_back("weather");
    mix(sample.air_k);
    mix(static_cast<double>(sample.sim_time_ns));
    return true;
  }
  void reset() noexcept override {
    ++script_.resets;
    script_.order.emplace_back("reset");
    state_ = 0.0;
  }
  int submit(const renderer::FrameRequest& request) noexcept override {
    for (std::size_t slot = 0; slot < views_.size(); ++slot) {
      if (used_[slot].load()) {
        continue;
      }
      if (script_.on_submit) {
        script_.on_submit(request);
      }
      used_[slot].store(true);
      script_.held.fetch_add(1);
      script_.submitted.push_back(request);
      script_.order.emplace_back("submit");
      mix(static_cast<double>(request.frame_number));
      mix(static_cast<double>(request.sim_time_ns));
      mix(static_cast<double>(request.thermal_time_ns));
      mix(request.sensor_pose.position_world_m.x);
      mix(static_cast<double>(request.quality_level));
      mix(request.fov_h_rad);
      for (const auto& update : script_.foreseen) {
        mix(update.entity_id);
        mix(update.pose.position_world_m.x);
        mix(static_cast<double>(script_.foreseen_ns));
      }
      auto& pixels = pixels_[slot];
      for (std::size_t i = 0; i < pixels.size(); ++i) {
        pixels[i] = static_cast<float>(state_ + static_cast<double>(i));
      }
      auto& view = views_[slot];
      view.frame_number = request.frame_number;
      view.sim_time_ns = request.sim_time_ns;
      view.sensor_pose = request.sensor_pose;
      view.stats.dropped_poses = script_.dropped_poses;
      view.stats.coarse = script_.coarse;
      view.stats.heat_limits = script_.heat_limits;
      view.stats.plain_targets = script_.plain_targets;
      view.quality_level = request.quality_level;
      view.estimated_error_k =
          request.quality_level < script_.quality_levels.size()
              ? static_cast<float>(script_.quality_levels[request.quality_level].error_k)
              : 0.0F;
      view.width_px = info_.width_px;
      view.height_px = info_.height_px;
      view.radiance_w_m2_sr = {std::span<const float>(pixels)};
      return static_cast<int>(slot);
    }
    return -1;
  }
  bool poll(renderer::SlotIndex /*slot*/) noexcept override { return script_.ready; }
  const renderer::FrameView& collect(renderer::SlotIndex slot) noexcept override {
    views_[slot].device_lost = script_.device_lost.load();
    views_[slot].device_failed = script_.device_failed.load() || views_[slot].device_lost;
    return views_[slot];
  }
  void release(renderer::SlotIndex slot) noexcept override {
    used_[slot].store(false);
    script_.held.fetch_sub(1);
  }
  std::span<const renderer::QualityLevelStats> expected_levels(
      const renderer::FrameRequest& /*request*/) noexcept override {
    return script_.quality_levels;
  }
  const server::SourceInfo& info() const noexcept override { return info_; }

 private:
  /// Returns a sum that depends on the order of the values and stays small enough for float.
  void mix(double value) noexcept {
    state_ = state_ * 0.61803 + value * 1e-3;
    state_ -= static_cast<double>(static_cast<std::int64_t>(state_ / 1000.0)) * 1000.0;
  }

  SourceScript& script_;
  server::SourceInfo info_;
  std::vector<std::vector<float>> pixels_;
  std::vector<renderer::FrameView> views_;
  std::array<std::atomic<bool>, server::kMaxSlots> used_{};
  double state_ = 0.0;
};

}  // namespace emit::test
