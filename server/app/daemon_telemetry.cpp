// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "app/daemon_impl.hpp"
#include "emit/version.hpp"
#include "net/ip_address.hpp"

/// Reports of the daemon about itself: metrics over HTTP, the log, the state of the clocks.
namespace emit::server {

using physics::Error;
using physics::ErrorCode;

std::string DaemonImpl::ready_line() const {
  const SocketAddress host = receiver_->host_address();
  return fmt::format("ready control={} host_udp={}{}{}", to_string(receiver_->control_address()),
                     host.length != 0 ? to_string(host) : std::string("off"),
                     triggers_ ? " trigger=" + to_string(triggers_->address()) : std::string(),
                     metrics_ ? " metrics=" + to_string(metrics_->address()) : std::string());
}

physics::Result<void> DaemonImpl::open_metrics(MetricsText::Labels build) {
  for (AgentRunner* runner : {receiver_runner_.get(), conductor_runner_.get(), render_runner_.get(),
                              sender_runner_.get(), recorder_runner_.get()}) {
    sources_.agents.emplace_back(runner->agent().name(), &runner->duty_cycle());
  }
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
  sources_.board = &board_;
  sources_.build = std::move(build);
  MetricsServer::Answers answers;
  answers.metrics = [this] { return metrics_text(sources_, moment()); };
  answers.trace = [this] { return chrome_trace(context_.trace.entries()); };
  answers.ready = [this] { return liveness_.is_ready(context_); };
  answers.admits = [this](const SocketAddress& peer) {
    const protocol::IpAddress ip = ip_of(peer);
    if (receiver_->may_connect(ip)) {
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

void DaemonImpl::watch_ptp() {
  switch (ptp_->turn(clock_.monotonic_ns())) {
    case PtpMonitor::Change::none:
      return;
    case PtpMonitor::Change::went_down:
      log_->write(LogLevel::warn,
                  "event=ptp_silent effect=\"nobody says whether the clock follows its master\" "
                  "remedy=\"ptp4l, clock.ptp_socket and who may write to it\"");
      return;
    case PtpMonitor::Change::went_up:
    case PtpMonitor::Change::state:
      break;
  }
  const PtpStatus status = ptp_->status();
  log_->write(LogLevel::info,
              fmt::format("event=ptp state={} grandmaster={} offset_ns={}", to_string(status.state),
                          status.grandmaster, status.offset_ns));
}

void DaemonImpl::housekeep() {
  if (const std::int64_t step_ns = clock_watch_.look(); step_ns != 0 && log_) {
    context_.counters.add(Counter::clock_steps);
    log_->write(LogLevel::warn,
                fmt::format("event=clock_step by_ms={:.3f}", static_cast<double>(step_ns) * 1e-6));
  }
  bool warned = false;
  for (EventLog* events :
       {&context_.conductor_events, &context_.receiver_events, &context_.render_events,
        &context_.sender_events, &context_.recorder_events, &context_.metrics_events}) {
    while (const Event* event = events->ring().front()) {
      const EventText line = describe(*event);
      board_.note(*event);
      events->ring().pop();
      warned = warned || line.distinct;
      if (!log_) {
        continue;
      }
      // Errors have a table of their own, which peers cannot fill.
      DistinctTable& table = line.level == LogLevel::error ? errors_ : distinct_;
      const std::string text = line.distinct ? table.note(line.text, clock_.tai_ns()) : line.text;
      if (!text.empty()) {
        log_->write(line.level, text);
      }
    }
  }
  if (warned) {
    board_.set_warnings(LogLevel::warn, distinct_);
    board_.set_warnings(LogLevel::error, errors_);
  }
  liveness_.housekept_ns.store(clock_.monotonic_ns(), std::memory_order_release);
}

void DaemonImpl::log_summary() {
  std::string counters = "event=counters";
  for (std::size_t i = 0; i < kCounterCount; ++i) {
    const std::uint64_t value = context_.counters.get(static_cast<Counter>(i));
    if (value != 0) {
      counters += fmt::format(" {}={}", kCounterLabels[i].name, value);
    }
  }
  log_->write(LogLevel::info, counters);
  for (AgentRunner* runner : {receiver_runner_.get(), conductor_runner_.get(), render_runner_.get(),
                              sender_runner_.get(), recorder_runner_.get()}) {
    const DutyCycle& duty = runner->duty_cycle();
    log_->write(LogLevel::info,
                fmt::format("event=duty_cycle agent={} turns={} busy_ms={:.1f} max_turn_us={} "
                            "turns_over_1ms={}",
                            runner->agent().name(), duty.cycles(),
                            static_cast<double>(duty.busy_ns()) * 1e-6, duty.max_ns() / 1000,
                            duty.over_threshold()));
  }
}

}  // namespace emit::server
