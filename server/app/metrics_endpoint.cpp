// SPDX-License-Identifier: Apache-2.0
#include "app/metrics_endpoint.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <utility>

#include "app/service_health.hpp"
#include "net/ip_address.hpp"
#include "telemetry/http_address.hpp"

namespace emit::server {
physics::Result<std::unique_ptr<MetricsEndpoint>> MetricsEndpoint::open(
    const config::DaemonConfig& config, const Parts& parts, MetricsText::Labels build) {
  if (config.metrics.listen.empty()) {
    return nullptr;
  }
  const auto named = [&](physics::Error error) {
    return tl::unexpected<physics::Error>(
        std::move(error).with_context("metrics.listen").with_context(config.file.string()));
  };
  const auto address = http_address(config, config.metrics.listen, config::Port::metrics);
  if (!address) {
    return named(address.error());
  }
  std::unique_ptr<MetricsEndpoint> endpoint(new MetricsEndpoint(parts, std::move(build)));
  auto server = MetricsServer::start(*address, endpoint->answers());
  if (!server) {
    return named(std::move(server.error()));
  }
  endpoint->server_ = std::move(*server);
  return endpoint;
}

MetricsEndpoint::MetricsEndpoint(const Parts& parts, MetricsText::Labels build) : parts_(parts) {
  starting_.counters = &parts_.context.counters;
  starting_.times = &parts_.context.times;
  starting_.prediction = &parts_.context.prediction;
  starting_.motion = parts_.motion ? &parts_.context.motion_times : nullptr;
  starting_.realtime = &parts_.realtime;
  starting_.clients = parts_.context.clients();
  starting_.board = &parts_.board;
  starting_.build = std::move(build);
}

void MetricsEndpoint::serve(const NamedDutyCycles& duty_cycles, MetricsText::Labels build) {
  serving_ = starting_;
  serving_.agents = duty_cycles;
  serving_.build = std::move(build);
  sources_.store(&serving_, std::memory_order_release);
}

MetricsServer::Answers MetricsEndpoint::answers() const {
  MetricsServer::Answers answers;
  answers.metrics = [this] {
    return metrics_text(*sources_.load(std::memory_order_acquire), moment());
  };
  answers.trace = [this] { return chrome_trace(parts_.context.trace.entries()); };
  answers.why_not_ready = [this] { return why_not_ready(); };
  answers.admits = [this](const SocketAddress& peer) { return admits(peer); };
  answers.healthy = [this] { return is_healthy(); };
  return answers;
}

MetricsMoment MetricsEndpoint::moment() const {
  const Context& context = parts_.context;
  const std::int64_t now_ns = context.clock.monotonic_ns();
  return {context.run_id.load(std::memory_order_relaxed),
          parts_.liveness.is_ready(context),
          parts_.liveness.warmed_up_frac.load(std::memory_order_relaxed),
          now_ns - parts_.liveness.started_ns,
          now_ns,
          context.journal_memory_bytes.load(std::memory_order_relaxed),
          parts_.ptp != nullptr ? std::optional(parts_.ptp->status()) : std::nullopt};
}

bool MetricsEndpoint::admits(const SocketAddress& peer) const {
  const protocol::IpAddress ip = ip_of(peer);
  if (parts_.receiver.may_connect(ip)) {
    return true;
  }
  parts_.context.counters.add(Counter::peers_refused);
  parts_.context.metrics_events.push(EventKind::peer_refused,
                                     static_cast<std::uint64_t>(PeerRefusal::not_allowed), 0,
                                     protocol::to_string(ip));
  return false;
}

bool MetricsEndpoint::is_healthy() const {
  const MetricsSources* const sources = sources_.load(std::memory_order_acquire);
  // Main waits for the warm-up, which may take minutes; a start that fails ends the process.
  if (sources == &starting_) return true;
  const std::int64_t now_ns = parts_.context.clock.monotonic_ns();
  return parts_.liveness.is_main_alive(now_ns) &&
         ServiceHealth::stuck_agent(sources->agents, now_ns, ServiceHealth::kStuckNs).empty();
}

std::string MetricsEndpoint::why_not_ready() const {
  if (parts_.liveness.is_ready(parts_.context)) return {};
  if (sources_.load(std::memory_order_acquire) == &starting_) {
    const double frac = parts_.liveness.warmed_up_frac.load(std::memory_order_relaxed);
    return fmt::format("emitd starts; its surface is warmed up to {:.0f} %",
                       std::floor(100.0 * frac));
  }
  return parts_.liveness.serving.load(std::memory_order_acquire)
             ? "the surface warms up again behind a jump of simulation time"
             : "emitd begins to serve, or stops";
}

}  // namespace emit::server
