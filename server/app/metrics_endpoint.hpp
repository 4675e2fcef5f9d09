// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <memory>
#include <string>

#include "agents/context.hpp"
#include "agents/receiver/receiver.hpp"
#include "app/liveness.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "host/realtime.hpp"
#include "net/socket_address.hpp"
#include "telemetry/duty_cycle.hpp"
#include "telemetry/metrics_server.hpp"
#include "telemetry/metrics_text.hpp"
#include "telemetry/ptp_monitor.hpp"
#include "telemetry/status_board.hpp"

namespace emit::server {

/// The HTTP port of the daemon: /metrics, /trace, /healthz and /readyz, answered from the parts of
/// the daemon that it reads. It answers while the surface still warms up, so that a rig can tell a
/// daemon that starts from one that is not there. Threads: main makes and destroys it; the answers
/// are made on the thread of the MetricsServer.
class MetricsEndpoint {
 public:
  /// Parts of the daemon that the answers read. All of them outlive the endpoint.
  struct Parts {
    Context& context;
    const Liveness& liveness;
    const StatusBoard& board;
    const RealtimeReport& realtime;
    const Receiver& receiver;  ///< it decides which peers may ask
    const PtpMonitor* ptp;     ///< null: nobody asks ptp4l
    bool motion = false;       ///< a motion simulator is driven
  };

  /// Opens metrics.listen and starts the thread; null when metrics.listen is empty. Agents are not
  /// told of before serve().
  /// @param build  labels of emitd_build_info until then
  /// Errors: config (no address, or one that other hosts reach without protection), io (address in
  /// use); they name the key and the file.
  [[nodiscard]] static physics::Result<std::unique_ptr<MetricsEndpoint>> open(
      const config::DaemonConfig& config, const Parts& parts, MetricsText::Labels build);

  [[nodiscard]] SocketAddress address() const noexcept { return server_->address(); }
  /// Tells of the agents from here on. Call it once, when they are made.
  /// @param duty_cycles  of all agents; they outlive the endpoint
  /// @param build        labels of emitd_build_info
  void serve(const NamedDutyCycles& duty_cycles, MetricsText::Labels build);

 private:
  MetricsEndpoint(const Parts& parts, MetricsText::Labels build);
  [[nodiscard]] MetricsServer::Answers answers() const;
  [[nodiscard]] MetricsMoment moment() const;
  [[nodiscard]] bool admits(const SocketAddress& peer) const;
  [[nodiscard]] bool is_healthy() const;
  [[nodiscard]] std::string why_not_ready() const;

  Parts parts_;
  MetricsSources starting_;  ///< without agents
  MetricsSources serving_;
  std::atomic<const MetricsSources*> sources_{&starting_};  ///< one of the two
  std::unique_ptr<MetricsServer> server_;                   ///< its thread reads all of the above
};

}  // namespace emit::server
