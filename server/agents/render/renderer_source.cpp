// SPDX-License-Identifier: Apache-2.0
#include "agents/frame_source.hpp"

namespace emit::server {
namespace {

class RendererSource final : public FrameSource {
 public:
  RendererSource(std::unique_ptr<renderer::Renderer> renderer, SourceInfo info)
      : renderer_(std::move(renderer)), info_(std::move(info)) {}

  std::size_t apply_entities(std::int64_t sim_time_ns,
                             std::span<const renderer::EntityUpdate> updates) noexcept override {
    return renderer_->apply_entities(sim_time_ns, updates);
  }
  void foresee_entities(std::int64_t sim_time_ns,
                        std::span<const renderer::EntityUpdate> updates) noexcept override {
    renderer_->foresee_entities(sim_time_ns, updates);
  }
  bool apply_part(std::int64_t sim_time_ns, const renderer::PartUpdate& update) noexcept override {
    return renderer_->apply_part(sim_time_ns, update);
  }
  bool apply_weather(const scene::WeatherSample& sample) noexcept override {
    return renderer_->apply_weather(sample);
  }
  void reset() noexcept override { renderer_->reset(); }
  int submit(const renderer::FrameRequest& request) noexcept override {
    return renderer_->submit(request);
  }
  bool poll(renderer::SlotIndex slot) noexcept override { return renderer_->poll(slot); }
  const renderer::FrameView& collect(renderer::SlotIndex slot) noexcept override {
    return renderer_->collect(slot);
  }
  void release(renderer::SlotIndex slot) noexcept override { renderer_->release(slot); }
  std::span<const renderer::QualityLevelStats> expected_levels(
      const renderer::FrameRequest& request) noexcept override {
    return renderer_->expected_levels(request);
  }
  const SourceInfo& info() const noexcept override { return info_; }

 private:
  std::unique_ptr<renderer::Renderer> renderer_;
  SourceInfo info_;
};

}  // namespace

physics::Result<std::unique_ptr<FrameSource>> make_renderer_source(
    const scene::ScenarioDesc& scenario, const renderer::DeviceOptions& device,
    const renderer::OutputOptions& output, std::int64_t first_time_ns,
    const renderer::WarmUpProgress& progress) {
  auto renderer = renderer::Renderer::create(scenario, device, output);
  if (!renderer) {
    return tl::unexpected<physics::Error>(std::move(renderer.error()));
  }
  // The warm-up makes the first frame as fast as the thousandth.
  renderer::FrameRequest first;
  first.sim_time_ns = first_time_ns;
  first.thermal_time_ns = first_time_ns;
  first.sensor_pose = (*renderer)->scenario_sensor_pose_at(first_time_ns);
  if (auto warm = (*renderer)->warm_up(first, progress); !warm) {
    return tl::unexpected<physics::Error>(std::move(warm.error()));
  }
  SourceInfo info;
  info.device = (*renderer)->device_name();
  info.width_px = scenario.sensor.width_px;
  info.height_px = scenario.sensor.height_px;
  info.slots = output.slots;
  info.planes = scenario.bands.size();
  info.surface_step_ns = static_cast<std::int64_t>(scenario.thermal.first_step_s * 1e9);
  if (scenario.thermal.method == scene::ThermalMethod::cached) info.first_time_ns = first_time_ns;
  info.scene = (*renderer)->scene_stats();
  return std::make_unique<RendererSource>(std::move(*renderer), std::move(info));
}

}  // namespace emit::server
