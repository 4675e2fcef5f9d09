// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "agents/context.hpp"
#include "agents/frame_source.hpp"
#include "agents/recorder/recorder.hpp"
#include "app/clock_watch.hpp"
#include "app/process_names.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "net/socket.hpp"
#include "telemetry/duty_cycle.hpp"
#include "telemetry/log.hpp"
#include "telemetry/progress.hpp"
#include "telemetry/ptp_monitor.hpp"
#include "telemetry/status_board.hpp"

namespace emit::server {

/// The daemon's log: its lines about start, clocks and end, and the events of the agents as text.
/// It also keeps the distinct warnings and the connections that /metrics shows.
/// Threads: main, except warming_up() and board().
class DaemonLog {
 public:
  /// `context` outlives the log.
  explicit DaemonLog(Context& context)
      : context_(context), clock_(context.clock), clock_watch_(context.clock) {}

  /// Opens the log. `on_line`, where it is set, takes the lines in place of what `config` names.
  /// Errors (io): the log file.
  [[nodiscard]] physics::Result<void> open(const config::LogConfig& config,
                                           const std::function<void(const std::string&)>& on_line);

  /// @pre open() succeeded; likewise for every function below that writes a line.
  void write(LogLevel level, const std::string& text);
  /// Writes a warning and keeps it among those that /metrics shows. Setup only.
  void warn(const std::string& text);
  /// Writes what the process is made of. `scenario_file`: empty, there is none.
  void software(const ProcessNames& names, const std::filesystem::path& scenario_file,
                const SourceInfo& source);
  /// Writes what happened to journals when the journal was opened.
  void journal(const Recorder::Opened& opened);
  void scene(const renderer::SceneStats& scene);
  /// Writes what is done to the pictures of channels, with a warning for pixels that show nothing.
  void outputs(const std::vector<Channel>& channels, const std::vector<Picture>& pictures);
  void shared_memory(const config::StreamConfig& stream);
  void congestion_control(const CongestionControl& tcp);
  /// Warns when the kernel's TAI offset was not set.
  void tai_offset();
  /// Writes the progress of the warm-up every few seconds.
  /// Thread: the render agent's, before it serves.
  void warming_up(double done_frac);
  void ptp(PtpMonitor::Change change, const PtpMonitor& monitor);
  /// Writes every counter that is not 0 and the duty cycle of every agent.
  void summary(const NamedDutyCycles& agents);

  /// Takes the agents' events and looks for a step of the wall clock. Without a log the events are
  /// taken all the same.
  void housekeep();

  /// Waits, within the limit, until every line is written. Later lines are lost.
  void finish(std::int64_t limit_ns);
  /// Returns false after finish() when nobody took the last lines.
  [[nodiscard]] bool taken() const noexcept { return taken_; }

  /// Returns the connections and warnings. Thread: any.
  [[nodiscard]] const StatusBoard& board() const noexcept { return board_; }

 private:
  void note_clock_step();
  void take_events();

  Context& context_;
  const Clock& clock_;
  std::unique_ptr<Log> log_;
  bool taken_ = true;
  DistinctTable distinct_;
  DistinctTable errors_;  ///< a table that peers cannot fill
  StatusBoard board_;
  ClockWatch clock_watch_;
  std::optional<ProgressMeter> warm_up_meter_;  ///< from the first report on
};

}  // namespace emit::server
