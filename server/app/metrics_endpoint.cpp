// SPDX-License-Identifier: Apache-2.0
#include "app/metrics_endpoint.hpp"

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
  sources_.counters = &parts_.context.counters;
  sources_.times = &parts_.context.times;
  sources_.prediction = &parts_.context.prediction;
  sources_.motion = parts_.motion ? &parts_.context.motion_times : nullptr;
  sources_.realtime = &parts_.realtime;
  sources_.clients = parts_.context.clients();
  sources_.board = &parts_.board;
  sources_.agents = parts_.duty_cycles;
  sources_.build = std::move(build);
}

MetricsServer::Answers MetricsEndpoint::answers() const {
  MetricsServer::Answers answers;
  answers.metrics = [this] { return metrics_text(sources_, moment()); };
  answers.trace = [this] { return chrome_trace(parts_.context.trace.entries()); };
  answers.ready = [this] { return parts_.liveness.is_ready(parts_.context); };
  answers.admits = [this](const SocketAddress& peer) { return admits(peer); };
  answers.healthy = [this] { return is_healthy(); };
  return answers;
}

MetricsMoment MetricsEndpoint::moment() const {
  const Context& context = parts_.context;
  const std::int64_t now_ns = context.clock.monotonic_ns();
  return {context.run_id.load(std::memory_order_relaxed),
          parts_.liveness.is_ready(context),
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
  const std::int64_t now_ns = parts_.context.clock.monotonic_ns();
  return parts_.liveness.is_main_alive(now_ns) &&
         ServiceHealth::stuck_agent(sources_.agents, now_ns, ServiceHealth::kStuckNs).empty();
}

}  // namespace emit::server
