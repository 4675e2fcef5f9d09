// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "app/daemon_impl.hpp"
#include "emit/version.hpp"
#include "net/ip_address.hpp"

/// Reports of the daemon about itself: metrics over HTTP.
namespace emit::server {

using physics::Error;
using physics::ErrorCode;

std::string DaemonImpl::ready_line() const {
  const SocketAddress host = agents_.receiver().host_address();
  return fmt::format("ready control={} host_udp={}{}{}",
                     to_string(agents_.receiver().control_address()),
                     host.length != 0 ? to_string(host) : std::string("off"),
                     triggers_ ? " trigger=" + to_string(triggers_->address()) : std::string(),
                     metrics_ ? " metrics=" + to_string(metrics_->address()) : std::string());
}

physics::Result<void> DaemonImpl::open_metrics(MetricsText::Labels build) {
  if (config_.metrics.listen.empty()) {
    return {};
  }
  const auto named = [this](const Error& error) {
    return tl::unexpected<Error>(
        Error(error).with_context("metrics.listen").with_context(config_.file.string()));
  };
  const auto where = parse_host_port(config_.metrics.listen);
  if (!where) {
    return named(where.error());
  }
  const auto address = resolve(*where, Transport::tcp, true);
  if (!address) {
    return named(address.error());
  }
  if (!ip_of(*address).is_loopback() && !config::is_protected(config_, config::Port::metrics)) {
    return named({ErrorCode::config,
                  fmt::format("{}: other hosts may reach it: that needs {}", to_string(*address),
                              config::protections_of(config::Port::metrics))});
  }
  sources_.counters = &context_.counters;
  sources_.times = &context_.times;
  sources_.prediction = &context_.prediction;
  sources_.realtime = &realtime_;
  sources_.clients = context_.clients();
  sources_.agents = agents_.duty_cycles();
  sources_.board = &log_.board();
  sources_.build = std::move(build);
  MetricsServer::Answers answers;
  answers.metrics = [this] { return metrics_text(sources_, moment()); };
  answers.trace = [this] { return chrome_trace(context_.trace.entries()); };
  answers.ready = [this] { return liveness_.is_ready(context_); };
  answers.admits = [this](const SocketAddress& peer) {
    const protocol::IpAddress ip = ip_of(peer);
    if (agents_.receiver().may_connect(ip)) {
      return true;
    }
    context_.counters.add(Counter::peers_refused);
    context_.metrics_events.push(EventKind::peer_refused,
                                 static_cast<std::uint64_t>(PeerRefusal::not_allowed), 0,
                                 protocol::to_string(ip));
    return false;
  };
  answers.healthy = [this] {
    const std::int64_t now_ns = clock_.monotonic_ns();
    return liveness_.is_main_alive(now_ns) &&
           ServiceHealth::stuck_agent(sources_.agents, now_ns, ServiceHealth::kStuckNs).empty();
  };
  auto opened = MetricsServer::start(*address, std::move(answers));
  if (!opened) {
    return named(opened.error());
  }
  metrics_ = std::move(*opened);
  return {};
}

MetricsMoment DaemonImpl::moment() const {
  const std::int64_t now_ns = clock_.monotonic_ns();
  return {context_.run_id.load(std::memory_order_relaxed),
          liveness_.is_ready(context_),
          now_ns - liveness_.started_ns,
          now_ns,
          context_.journal_memory_bytes.load(std::memory_order_relaxed),
          ptp_ ? std::optional(ptp_->status()) : std::nullopt};
}

}  // namespace emit::server
