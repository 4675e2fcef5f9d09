// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "emit/client/security.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "tool/view/view_control.hpp"

namespace emit::tool::view {

/// Choice of the source that is viewed.
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

/// Image that the thread that makes it hands to the window.
struct ViewFrame {
  std::uint64_t serial = 0;  ///< counts up; 0: none yet
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::vector<float> radiance_w_m2_sr;
  std::vector<float> temperature_k;  ///< of the surface, or apparent; see apparent_temperature
  bool apparent_temperature = false;
  std::string_view unit;  ///< of the radiance, where it is another quantity; empty: W m-2 sr-1
  std::uint64_t frame_number = 0;
  std::int64_t sim_time_ns = 0;
  std::uint32_t flags = 0;
  double frame_ms = 0.0;  ///< time to make it, or pose to reception

  // Only scenarios fill these. Planes are NaN where there is sky; `material` has no meaning there.
  physics::Pose sensor_pose;
  std::vector<float> material;  ///< index into `material_names`
  std::vector<float> sun_cosine;
  std::vector<float> sky_frac;
  std::vector<std::uint32_t> sample_px;  ///< pixels that hold a thermal sample, if asked for
  std::shared_ptr<const std::vector<std::string>> material_names;
  std::uint8_t quality_level = 0;
  /// Lines about the pixel that was asked for last; null: none yet.
  std::shared_ptr<const std::vector<std::string>> report;
};

/// Reason why no more frames come.
struct ViewEnd {
  std::string reason;
  bool failure = false;  ///< an error of ours; else the other side ended a stream
};

/// Slot between a producer thread and the window's thread that keeps only the newest frame.
class FrameSlot {
 public:
  /// Swaps the frame in. `frame` gets an old buffer back for reuse. Thread: the producer.
  void put(ViewFrame& frame);
  /// Exchanges `frame` for a newer one. It returns false when there is none. Thread: the window's.
  bool take(ViewFrame& frame);
  /// Ends the stream of frames with a reason. Thread: the producer.
  void end(std::string reason, bool failure);
  [[nodiscard]] std::optional<ViewEnd> ended();

 private:
  std::mutex mutex_;
  ViewFrame slot_;
  std::uint64_t serial_ = 0;
  std::optional<ViewEnd> end_;
};

/// Source of images with a thread of its own. The window's thread calls everything.
class FrameProvider {
 public:
  virtual ~FrameProvider() = default;
  [[nodiscard]] virtual bool take(ViewFrame& frame) = 0;
  virtual void control(const ViewControl& control) = 0;
  [[nodiscard]] virtual std::optional<ViewEnd> ended() = 0;
  /// Returns the channel or the scenario, for the window's title.
  [[nodiscard]] virtual std::string title() const = 0;
  [[nodiscard]] virtual std::string band() const = 0;
  /// Returns the initial limits of the false colours, K.
  virtual void limits(double& min_k, double& max_k) const = 0;
  /// Returns the local solar time of an instant, 0..24 h; empty: the source has a clock of its own.
  [[nodiscard]] virtual std::optional<double> solar_hour(std::int64_t /*sim_time_ns*/) const {
    return std::nullopt;
  }
  /// Returns how much of a jump in time is done, 0..1; empty: there is none.
  [[nodiscard]] virtual std::optional<double> travelled_frac() const { return std::nullopt; }
};

/// Renders a scenario on a thread that owns the GL context of the renderer. Errors: those of
/// load_scenario (code config) and of Renderer::create().
[[nodiscard]] physics::Result<std::unique_ptr<FrameProvider>> make_scenario_provider(
    const SourceOptions& options);
/// Receives a daemon's stream.
[[nodiscard]] physics::Result<std::unique_ptr<FrameProvider>> make_stream_provider(
    const SourceOptions& options);

}  // namespace emit::tool::view
