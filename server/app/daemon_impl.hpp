// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "agents/conductor/conductor.hpp"
#include "agents/context.hpp"
#include "agents/receiver/receiver.hpp"
#include "agents/recorder/recorder.hpp"
#include "agents/render/render_agent.hpp"
#include "agents/runner.hpp"
#include "agents/sender/sender.hpp"
#include "agents/sender/shm_client.hpp"
#include "app/daemon.hpp"
#include "app/daemon_log.hpp"
#include "app/liveness.hpp"
#include "app/process_names.hpp"
#include "app/service_health.hpp"
#include "net/trigger_port.hpp"
#include "telemetry/metrics_server.hpp"
#include "telemetry/metrics_text.hpp"
#include "telemetry/ptp_monitor.hpp"

namespace emit::server {

/// The daemon: makes the agents, turns or watches them, and leads the shutdown (daemon.cpp). It
/// reports about itself in daemon_telemetry.cpp. Thread: main, unless a function says otherwise.
class DaemonImpl final : public Daemon {
 public:
  DaemonImpl(const config::DaemonConfig& config, std::optional<scene::ScenarioDesc> scenario,
             DaemonOptions options);
  ~DaemonImpl() override {
    metrics_.reset();
    if (options_.stepped && conductor_runner_) {
      drain_stepped();
    }
    stop_agents();
    housekeep();
  }

  [[nodiscard]] physics::Result<void> setup();

  int run() override;
  bool log_taken() const noexcept override { return log_.taken(); }
  void request_stop() noexcept override {
    stop_.store(true, std::memory_order_release);
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = ::write(stop_event_.get(), &one, sizeof(one));
  }
  int step() override;

  std::uint16_t control_port() const noexcept override {
    return receiver_->control_address().port();
  }
  std::uint16_t host_udp_port() const noexcept override {
    const SocketAddress address = receiver_->host_address();
    return address.length != 0 ? address.port() : std::uint16_t{0};
  }
  std::uint64_t counter(Counter id) const noexcept override { return context_.counters.get(id); }
  std::string ready_line() const override;
  std::uint16_t metrics_port() const noexcept override {
    return metrics_ ? metrics_->address().port() : std::uint16_t{0};
  }
  std::uint16_t trigger_port() const noexcept override {
    return triggers_ ? triggers_->address().port() : std::uint16_t{0};
  }

 private:
  [[nodiscard]] FrameSourceFactory source_factory();
  // The functions below are the steps of setup(), in their order.
  [[nodiscard]] physics::Result<void> open_clocks();
  [[nodiscard]] physics::Result<void> open_ports();
  [[nodiscard]] physics::Result<void> check_realtime();
  [[nodiscard]] physics::Result<void> start_render();
  [[nodiscard]] physics::Result<void> make_agents(const SourceInfo& source);
  [[nodiscard]] physics::Result<void> make_recorder(const ProcessNames& names);
  [[nodiscard]] physics::Result<void> make_sender(const SourceInfo& source);
  void log_start(const ProcessNames& names, const SourceInfo& source);
  [[nodiscard]] physics::Result<void> make_runners();
  [[nodiscard]] physics::Result<void> open_metrics(MetricsText::Labels build);
  /// Returns the runners that start after the render agent's, in the order of their start.
  [[nodiscard]] std::array<AgentRunner*, 4> serving_runners() const noexcept {
    return {recorder_runner_.get(), sender_runner_.get(), conductor_runner_.get(),
            receiver_runner_.get()};
  }
  /// Runs one turn of the main thread while serving: waits up to 100 ms, then checks the agents.
  void watch_once();
  [[nodiscard]] int end_in_order();
  template <class Predicate>
  bool wait_until(Predicate done, std::int64_t limit_ns);
  void drain_stepped();
  void stop_agents();
  [[nodiscard]] int end_without_device();
  [[nodiscard]] MetricsMoment moment() const;
  void housekeep();
  /// Sends the progress of the warm-up to the service manager and, every few seconds, to the log.
  /// Returns true: the warm-up goes on. Thread: the render agent's, before it serves.
  bool warming_up(double done_frac);
  void plan_realtime(AgentRunner& runner) const {
    runner.set_realtime(thread_realtime(config_.realtime, runner.agent().name()));
  }

  config::DaemonConfig config_;
  std::optional<scene::ScenarioDesc> scenario_;
  DaemonOptions options_;
  SystemClock system_clock_;
  const Clock& clock_;
  ScenarioTracks tracks_;
  Context context_;
  DaemonLog log_;
  std::string privileges_;  ///< what was given up, for the log
  Fd stop_event_;
  std::atomic<bool> stop_{false};
  Liveness liveness_;

  ServiceNotifier nobody_;
  ServiceHealth health_{options_.notifier != nullptr ? *options_.notifier : nobody_};
  RealtimeReport realtime_;
  std::unique_ptr<PtpMonitor> ptp_;
  std::unique_ptr<TriggerPort> triggers_;
  std::unique_ptr<Receiver> receiver_;
  std::unique_ptr<RenderAgent> render_;
  std::unique_ptr<Recorder> recorder_;
  std::unique_ptr<ShmClient> shm_;
  std::unique_ptr<Sender> sender_;
  std::unique_ptr<Conductor> conductor_;
  std::unique_ptr<AgentRunner> receiver_runner_;
  std::unique_ptr<AgentRunner> render_runner_;
  std::unique_ptr<AgentRunner> recorder_runner_;
  std::unique_ptr<AgentRunner> sender_runner_;
  std::unique_ptr<AgentRunner> conductor_runner_;
  MetricsSources sources_;
  std::unique_ptr<MetricsServer> metrics_;  ///< reads all of the above
};

}  // namespace emit::server
