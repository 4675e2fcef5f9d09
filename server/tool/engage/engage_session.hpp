// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <chrono>
#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emit/client/client.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/scene/scene_desc.hpp"
#include "tool/engage/flight_host.hpp"
#include "tool/engage/loop_record.hpp"
#include "tool/engage/seeker_process.hpp"
#include "tool/support/daemon_process.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/work_folder.hpp"

namespace emit::tool {

/// Settings of the programs around the host.
struct SessionOptions {
  std::vector<std::string> set;  ///< --set of the scenario
  std::string channel;           ///< that the seeker reads; empty: the first one
  std::string seeker;            ///< shell command; empty: the reference seeker
  std::string method = "hot-spot";
  double rate_hz = 100.0;
  double duration_s = 30.0;
  bool real_time = false;
  double display_delay_ms = 40.0;   ///< real time: from the begin of a slot to the display
  std::uint32_t target_entity = 0;  ///< real time: that the target rings point to
  /// Shares of the flight at which a picture is kept, ascending.
  std::vector<double> film_frac{0.0, 0.3, 0.55, 0.75, 0.88, 0.95, 0.985};
  std::filesystem::path out;
};

/// Real time: the missile rests on its launcher so long, in which the axes set off softly.
inline constexpr std::int64_t kHoldNs = 8'000'000'000;

/// emitd, the seeker, and in real time the motion simulator, as processes on this machine, with the
/// connections of the host to them. Single thread, setup and loop.
class EngageSession {
 public:
  /// @pre the objects outlive the session
  EngageSession(const SessionOptions& options, const scene::ScenarioDesc& scenario,
                std::int64_t start_ns, WorkFolder& work)
      : options_(options), scenario_(scenario), start_ns_(start_ns), work_(work) {}

  /// Starts the programs and waits until they are ready. Errors: those of DaemonProcess and
  /// SeekerProcess; io.
  [[nodiscard]] physics::Result<void> start();
  /// Flies in lock-step: pose k makes frame k, the seeker answers it, the host takes the answer and
  /// flies on by one period. Errors: io, protocol.
  [[nodiscard]] physics::Result<LoopRecord> fly_in_steps(FlightHost& host);
  /// Flies by the wall clock: poses go out at the rate, and answers are taken when they come.
  /// Errors: io, protocol.
  [[nodiscard]] physics::Result<LoopRecord> fly_in_real_time(FlightHost& host);
  /// Ends the programs. Errors: io.
  [[nodiscard]] physics::Result<void> stop();

  [[nodiscard]] const std::string& device() const noexcept { return frames_->server().device; }
  [[nodiscard]] const client::ChannelDescription& channel() const noexcept { return channel_; }
  /// Returns the distance of the image plane, px.
  [[nodiscard]] double focal_px() const noexcept;
  /// Returns the log of the flown host frames.
  [[nodiscard]] std::filesystem::path flight_log() const { return options_.out / "flight.mcap"; }

 private:
  using Clock = std::chrono::steady_clock;
  [[nodiscard]] physics::Result<std::string> start_motion();
  [[nodiscard]] config::DaemonConfig daemon_config(const std::string& controller) const;
  [[nodiscard]] physics::Result<void> connect();
  void fill_host_frame(const FlightHost& host, std::uint64_t number, std::int64_t sim_time_ns);
  /// Sends the host frame and writes it to the log. Errors: io; protocol (emitd refused a frame).
  /// @param log  null: it is not written
  [[nodiscard]] physics::Result<void> send_host_frame(protocol::LogWriter* log);
  /// Waits for the frame of a host frame.
  [[nodiscard]] physics::Result<const client::ReceivedFrame*> frame_of_host(std::uint64_t number);
  [[nodiscard]] physics::Result<SeekerAnswer> answer_to_host(std::uint64_t number);
  /// Begins the record of a pose.
  [[nodiscard]] static LoopFrame frame_at(const FlightHost& host);
  /// Adds what header and answer say to the record of a pose, and hands the measured direction to
  /// the host.
  void take_answer(const protocol::FrameHeader& header, const SeekerAnswer& answer,
                   LoopFrame& frame, FlightHost& host) const;
  /// Keeps a picture if the flight has come to the next one's share.
  [[nodiscard]] physics::Result<void> keep_film(const client::ReceivedFrame& shown,
                                                const FlightHost& host, LoopRecord& record);
  [[nodiscard]] double progress_frac(const FlightHost& host) const noexcept;

  /// A run by the wall clock.
  struct RealTimeRun {
    Clock::time_point begin;                 ///< of the flight
    std::deque<protocol::FrameHeader> seen;  ///< of frames that may still be answered
    std::deque<Clock::time_point> sent;      ///< of the flight's poses
    protocol::MotionState motion = protocol::MotionState::none;
  };
  /// Receives frames and answers until an instant. The host and the record are those of the flight;
  /// before it they are null.
  [[nodiscard]] physics::Result<void> listen_until(Clock::time_point end, RealTimeRun& run,
                                                   FlightHost* host, LoopRecord* record);
  [[nodiscard]] physics::Result<void> take_frames(RealTimeRun& run, const FlightHost* host,
                                                  LoopRecord* record);
  void match(const SeekerAnswer& answer, RealTimeRun& run, FlightHost& host, LoopRecord& record);
  [[nodiscard]] physics::Result<void> hold_for_axes(const FlightHost& host, RealTimeRun& run);

  const SessionOptions& options_;
  const scene::ScenarioDesc& scenario_;
  std::int64_t start_ns_;
  WorkFolder& work_;
  std::optional<LinePipe> motion_lines_;
  std::optional<Subprocess> motion_;
  std::optional<DaemonProcess> daemon_;
  std::optional<SeekerProcess> seeker_;
  std::unique_ptr<client::FrameClient> frames_;
  client::ChannelDescription channel_;
  std::unique_ptr<client::HostClient> host_;
  std::unique_ptr<protocol::HostFrameData> sent_ = std::make_unique<protocol::HostFrameData>();
  std::optional<ApparentTemperature> apparent_;
  std::size_t next_film_ = 0;
  double first_range_m_ = 0.0;
  std::uint64_t first_number_ = 1;  ///< of the flight's host frames
};

}  // namespace emit::tool
