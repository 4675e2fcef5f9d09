// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "agents/context.hpp"
#include "app/agent_set.hpp"
#include "app/console_endpoint.hpp"
#include "app/daemon.hpp"
#include "app/daemon_log.hpp"
#include "app/liveness.hpp"
#include "app/metrics_endpoint.hpp"
#include "app/process_names.hpp"
#include "app/service_health.hpp"
#include "net/trigger_port.hpp"
#include "telemetry/metrics_text.hpp"
#include "telemetry/ptp_monitor.hpp"

namespace emit::server {

/// The daemon: opens ports and clocks, has the agents made, turns or watches them, and leads the
/// shutdown. Agents, log and metrics are classes of their own. Thread: main, unless a function says
/// otherwise.
class DaemonImpl final : public Daemon {
 public:
  DaemonImpl(const config::DaemonConfig& config, std::optional<scene::ScenarioDesc> scenario,
             DaemonOptions options);
  ~DaemonImpl() override {
    console_.reset();
    endpoint_.reset();
    if (options_.stepped && agents_.is_made()) {
      agents_.drain_stepped([this] { return step(); });
    }
    agents_.stop();
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
    return agents_.receiver().control_address().port();
  }
  std::uint16_t host_udp_port() const noexcept override {
    const SocketAddress address = agents_.receiver().host_address();
    return address.length != 0 ? address.port() : std::uint16_t{0};
  }
  std::uint64_t counter(Counter id) const noexcept override { return context_.counters.get(id); }
  std::string ready_line() const override;
  std::uint16_t metrics_port() const noexcept override {
    return endpoint_ ? endpoint_->address().port() : std::uint16_t{0};
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
  [[nodiscard]] physics::Result<void> make_agents();
  void log_start(const ProcessNames& names);
  [[nodiscard]] physics::Result<void> open_endpoint();
  [[nodiscard]] static MetricsText::Labels build_labels(const ProcessNames& names);
  /// Returns the addresses that are open by now.
  [[nodiscard]] std::string addresses() const;
  [[nodiscard]] physics::Result<void> open_console(const ProcessNames& names);
  /// Runs one turn of the main thread while serving: waits up to 100 ms, then checks the agents.
  void watch_once();
  [[nodiscard]] int end_in_order();
  template <class Predicate>
  bool wait_until(Predicate done, std::int64_t limit_ns);
  [[nodiscard]] int end_without_device();
  void housekeep();
  /// Sends the progress of the warm-up to the service manager and, every few seconds, to the log.
  /// Returns true: the warm-up goes on. Thread: the render agent's, before it serves.
  bool warming_up(double done_frac);

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
  AgentSet agents_;
  std::unique_ptr<MetricsEndpoint> endpoint_;  ///< its thread reads all of the above
  std::unique_ptr<ConsoleEndpoint> console_;   ///< likewise
};

}  // namespace emit::server
