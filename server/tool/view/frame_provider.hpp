// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "emit/client/security.hpp"
#include "emit/physics/error.hpp"
#include "tool/view/view_control.hpp"

namespace emit::tool::view {

/// What is viewed.
struct SourceOptions {
  std::string source;  ///< a scenario (name or .toml file), or the URL of a daemon's stream
  std::vector<std::string> set;  ///< scenario: overrides of its keys
  std::optional<double>
      time_s;  ///< scenario: simulated time to start from; absent: the trajectory's start
  std::string channel_name;   ///< URL; empty: the first that fits
  std::string channel_kind;   ///< URL; empty: any
  std::string band;           ///< empty: the first
  int gpu_index = -1;         ///< scenario: EGL device; -1: the first hardware device, else Mesa
  client::Security security;  ///< URL

  [[nodiscard]] bool is_stream() const { return source.find("://") != std::string::npos; }
};

/// Picture handed from the thread that makes it to the window.
struct ViewFrame {
  std::uint64_t serial = 0;  ///< counts up; 0: none yet
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::vector<float> radiance_w_m2_sr;
  std::vector<float> temperature_k;  ///< of the surface, or apparent; see apparent_temperature
  bool apparent_temperature = false;
  std::uint64_t frame_number = 0;
  std::int64_t sim_time_ns = 0;
  std::uint32_t flags = 0;
  double frame_ms = 0.0;  ///< time to make it, or pose to reception
};

/// Why no more frames come.
struct ViewEnd {
  std::string reason;
  bool failure = false;  ///< an error of ours; else the other side ended a stream
};

/// Newest-wins slot between a producer thread and the window's thread.
class FrameSlot {
 public:
  /// Producer: swaps the frame in; `frame` gets an old buffer back for reuse.
  void put(ViewFrame& frame);
  /// Window: true when `frame` was exchanged for a newer one.
  bool take(ViewFrame& frame);
  /// Producer: ends the stream of frames with a reason.
  void end(std::string reason, bool failure);
  [[nodiscard]] std::optional<ViewEnd> ended();

 private:
  std::mutex mutex_;
  ViewFrame slot_;
  std::uint64_t serial_ = 0;
  std::optional<ViewEnd> end_;
};

/// Source of pictures with a thread of its own. The window's thread calls everything.
class FrameProvider {
 public:
  virtual ~FrameProvider() = default;
  [[nodiscard]] virtual bool take(ViewFrame& frame) = 0;
  virtual void control(const ViewControl& control) = 0;
  [[nodiscard]] virtual std::optional<ViewEnd> ended() = 0;
  /// Name, channel or scenario, for the window's title.
  [[nodiscard]] virtual std::string title() const = 0;
  [[nodiscard]] virtual std::string band() const = 0;
  /// Limits to begin with, K.
  virtual void limits(double& min_k, double& max_k) const = 0;
};

/// Renders a scenario on a thread that owns the GL context of the renderer. Errors as
/// load_scenario (code config) and Renderer::create.
[[nodiscard]] physics::Result<std::unique_ptr<FrameProvider>> make_scenario_provider(
    const SourceOptions& options);
/// Receives a daemon's stream.
[[nodiscard]] physics::Result<std::unique_ptr<FrameProvider>> make_stream_provider(
    const SourceOptions& options);

}  // namespace emit::tool::view
