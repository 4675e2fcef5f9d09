// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "emit/renderer/renderer.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::server {

/// Sensor channels that a source can fill, and the origin of its images.
struct SourceInfo {
  std::string device;   ///< GL renderer, or the origin of canned frames
  bool canned = false;  ///< pre-rendered pixels: frames carry kFlagCanned
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::uint32_t slots = 0;
  std::size_t planes = 0;  ///< FrameView::radiance_w_m2_sr.size() of every frame
  /// Step of the thermal clock from frame to frame beyond which the source may warm up again inside
  /// submit(), ns: the newest interval of the surface's history.
  std::int64_t surface_step_ns = 20'000'000'000;
  /// Simulation time that the surface is warmed up for; none: the source has no such surface.
  std::optional<std::int64_t> first_time_ns;
  renderer::SceneStats scene;  ///< warmed up; empty for pre-rendered pixels
};

/// Source of frames. The same calls, in the same order, give the same pixels: the journal and its
/// player rely on it.
///
/// Thread: the render agent owns the source from its factory to destruction; release() and info()
/// may be called by any thread. Real time: everything after construction is RT-safe.
class FrameSource {
 public:
  FrameSource() = default;
  FrameSource(const FrameSource&) = delete;
  FrameSource& operator=(const FrameSource&) = delete;
  virtual ~FrameSource() = default;

  virtual std::size_t apply_entities(std::int64_t sim_time_ns,
                                     std::span<const renderer::EntityUpdate> updates) noexcept = 0;
  /// See Renderer::foresee_entities(). Sources of stored images ignore it.
  virtual void foresee_entities(std::int64_t /*sim_time_ns*/,
                                std::span<const renderer::EntityUpdate> /*updates*/) noexcept {}
  /// Drives a part; see Renderer::apply_part(). Sources of stored images ignore it.
  virtual bool apply_part(std::int64_t /*sim_time_ns*/,
                          const renderer::PartUpdate& /*update*/) noexcept {
    return true;
  }
  virtual bool apply_weather(const scene::WeatherSample& sample) noexcept = 0;
  virtual void reset() noexcept = 0;

  /// Issues a frame; -1 when every slot is in use.
  [[nodiscard]] virtual int submit(const renderer::FrameRequest& request) noexcept = 0;
  /// True when collect() would not wait.
  [[nodiscard]] virtual bool poll(renderer::SlotIndex slot) noexcept = 0;
  /// Waits for the device. The view and its memory live until release().
  [[nodiscard]] virtual const renderer::FrameView& collect(renderer::SlotIndex slot) noexcept = 0;
  virtual void release(renderer::SlotIndex slot) noexcept = 0;

  /// Returns Renderer::expected_levels(). Sources without a ladder have one quality level.
  [[nodiscard]] virtual std::span<const renderer::QualityLevelStats> expected_levels(
      const renderer::FrameRequest& /*request*/) noexcept {
    static constexpr std::array<renderer::QualityLevelStats, 1> kFullOnly{};
    return kFullOnly;
  }

  [[nodiscard]] virtual const SourceInfo& info() const noexcept = 0;
};

/// Called once, on the thread that will own the source (a GL context is bound to its thread).
using FrameSourceFactory = std::function<physics::Result<std::unique_ptr<FrameSource>>()>;

/// Makes a source of frames of emit::renderer whose surface is warmed up for a frame at
/// `first_time_ns` of simulation time. `progress` is called with the part of the warm-up that is
/// done.
[[nodiscard]] physics::Result<std::unique_ptr<FrameSource>> make_renderer_source(
    const scene::ScenarioDesc& scenario, const renderer::DeviceOptions& device,
    const renderer::OutputOptions& output, std::int64_t first_time_ns,
    const renderer::WarmUpProgress& progress = {});

/// The images of make_canned_source() where `canned_dir` is empty: frame k shows the one at
/// (k - 1) modulo their number.
[[nodiscard]] std::vector<std::vector<float>> canned_pattern(const config::SourceConfig& source);

/// Pre-rendered frames: a folder of frame_*.exr with a `radiance` channel in name order, or a
/// moving test pattern; shown again and again. All memory is taken here. Errors: not_found (no
/// frame in the folder), parse (file at fault, or frames of different size).
[[nodiscard]] physics::Result<std::unique_ptr<FrameSource>> make_canned_source(
    const config::SourceConfig& source, std::uint32_t slots, std::size_t planes);

}  // namespace emit::server
