// SPDX-License-Identifier: Apache-2.0
#include "app/daemon.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <ctime>

#include "agents/conductor.hpp"
#include "agents/receiver.hpp"
#include "agents/recorder.hpp"
#include "agents/render_agent.hpp"
#include "agents/runner.hpp"
#include "agents/sender.hpp"
#include "agents/shm_client.hpp"
#include "app/clock_watch.hpp"
#include "app/context.hpp"
#include "app/privileges.hpp"
#include "app/replay.hpp"
#include "app/service_health.hpp"
#include "emit/version.hpp"
#include "io/ip_address.hpp"
#include "io/trigger_port.hpp"
#include "telemetry/log.hpp"
#include "telemetry/metrics_server.hpp"
#include "telemetry/metrics_text.hpp"
#include "telemetry/ptp_monitor.hpp"
#include "telemetry/status_board.hpp"

namespace emit::server {
namespace {

using physics::Error;
using physics::ErrorCode;

/// A frame in work may be a slow one (a software renderer takes seconds); a client that does not
/// read is given up soon.
constexpr std::int64_t kFramesDrainNs = 60'000'000'000;
constexpr std::int64_t kClientsDrainNs = 2'000'000'000;
constexpr std::int64_t kJournalDrainNs = 5'000'000'000;
/// After the device was lost a new process is wanted soon.
constexpr std::int64_t kLostDrainNs = 300'000'000;

std::uint32_t slot_count(const config::DaemonConfig& config) {
  return std::clamp<std::uint32_t>(config.stream.queue_frames + 3, 4, kMaxSlots);
}

std::size_t journal_bytes(const config::JournalConfig& config) {
  // A line is some hundred bytes; one with every entity of a frame about 20 KiB.
  constexpr std::size_t kBytesPerEntry = 1024;
  return std::max<std::size_t>(std::size_t{config.ring_entries} * kBytesPerEntry, 1u << 20);
}

std::string_view pacing_name(config::PacingMode mode) {
  switch (mode) {
    case config::PacingMode::host_step:
      break;
    case config::PacingMode::ig_clock:
      return "ig-clock";
    case config::PacingMode::trigger:
      return "trigger";
  }
  return "host-step";
}

class DaemonImpl final : public Daemon {
 public:
  DaemonImpl(const config::DaemonConfig& config, std::optional<scene::ScenarioDesc> scenario,
             DaemonOptions options)
      : config_(config),
        scenario_(std::move(scenario)),
        options_(std::move(options)),
        clock_(options_.clock != nullptr ? *options_.clock : system_clock_),
        tracks_(scenario_),
        context_(clock_, journal_bytes(config_.journal),
                 std::max<std::size_t>(config_.control.max_clients, 1)),
        stop_event_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {}

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
  std::string ready_line() const override {
    const SocketAddress host = receiver_->host_address();
    return fmt::format("ready control={} host_udp={}{}{}", to_string(receiver_->control_address()),
                       host.length != 0 ? to_string(host) : std::string("off"),
                       triggers_ ? " trigger=" + to_string(triggers_->address()) : std::string(),
                       metrics_ ? " metrics=" + to_string(metrics_->address()) : std::string());
  }
  std::uint16_t metrics_port() const noexcept override {
    return metrics_ ? metrics_->address().port() : std::uint16_t{0};
  }
  std::uint16_t trigger_port() const noexcept override {
    return triggers_ ? triggers_->address().port() : std::uint16_t{0};
  }

 private:
  [[nodiscard]] FrameSourceFactory source_factory();
  [[nodiscard]] physics::Result<void> make_agents(const SourceInfo& source);
  template <class Predicate>
  bool wait_until(Predicate done, std::int64_t limit_ns);
  void drain_stepped();
  void stop_agents();
  [[nodiscard]] int end_without_device();
  [[nodiscard]] physics::Result<void> open_metrics(MetricsText::Labels build);
  [[nodiscard]] MetricsMoment moment() const;
  void housekeep();
  void watch_ptp();
  void log_summary();
  [[nodiscard]] physics::Result<void> open_clocks();
  [[nodiscard]] physics::Result<void> check_realtime();
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
  std::unique_ptr<Log> log_;
  std::string privileges_;  ///< what was given up, for the log
  DistinctTable distinct_;
  DistinctTable errors_;
  StatusBoard board_;
  Fd stop_event_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> serving_{false};
  std::int64_t started_ns_ = 0;
  std::atomic<std::int64_t> housekept_ns_{0};  ///< monotonic
  ClockWatch clock_watch_{clock_};

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

FrameSourceFactory DaemonImpl::source_factory() {
  if (options_.source_factory) {
    return options_.source_factory;
  }
  if (config_.source.kind == config::SourceKind::canned) {
    return [this] {
      return make_canned_source(config_.source, slot_count(config_),
                                scenario_ ? scenario_->bands.size() : 1);
    };
  }
  return [this] {
    renderer::DeviceOptions device;
    device.gpu_index = config_.device.gpu_index;
    renderer::OutputOptions output;
    output.slots = slot_count(config_);
    const bool deadlines =
        config_.pacing.mode != config::PacingMode::host_step || config_.pacing.budget_ns > 0;
    output.ladder = deadlines ? renderer::Ladder::live : renderer::Ladder::none;
    return make_renderer_source(*scenario_, device, output,
                                [this](double done_frac) { return health_.warming_up(done_frac); });
  };
}

physics::Result<void> DaemonImpl::setup() {
  started_ns_ = clock_.monotonic_ns();
  housekept_ns_.store(started_ns_, std::memory_order_release);
  if (!scenario_ && !options_.source_factory &&
      config_.source.kind == config::SourceKind::renderer) {
    return physics::make_error(ErrorCode::config,
                               config_.file.string() + ": a renderer needs a scenario");
  }
  health_.starting();
  if (auto opened = open_clocks(); !opened) {
    return opened;
  }
  // Ports first: an address in use shows at once, not after a scene has been loaded.
  receiver_ = std::make_unique<Receiver>(context_, config_);
  if (auto opened = receiver_->open(); !opened) {
    return tl::unexpected<Error>(std::move(opened.error()).with_context(config_.file.string()));
  }
  if (options_.drop_privileges) {
    // While this thread is the only one: each has privileges of its own.
    auto dropped = drop_privileges();
    if (!dropped) {
      return tl::unexpected<Error>(std::move(dropped.error()));
    }
    privileges_ = std::move(*dropped);
  }
  if (options_.on_log) {
    log_ = make_log(options_.on_log);
  } else {
    auto log = make_log(config_.log);
    if (!log) {
      return tl::unexpected<Error>(std::move(log.error()));
    }
    log_ = std::move(*log);
  }
  if (!options_.stepped) {
    // With the privileges that stay, and before anything large is made: it comes from memory that
    // is locked.
    realtime_ = ask_for_realtime(config_.realtime);
    if (auto checked = check_realtime(); !checked) {
      return checked;
    }
  }
  if (!config_.stream.shm.empty()) {
    if (auto free = check_shm_name_free(config_.stream.shm); !free) {
      return tl::unexpected<Error>(std::move(free.error()).with_context("stream.shm"));
    }
  }
  render_ = std::make_unique<RenderAgent>(context_, source_factory());
  render_runner_ = std::make_unique<AgentRunner>(*render_, clock_);
  plan_realtime(*render_runner_);
  const bool started =
      options_.stepped ? render_runner_->start_stepped() : render_runner_->start_thread();
  if (!started) {
    return render_->source_info()
               ? physics::make_error(ErrorCode::internal, "the render thread did not start")
               : tl::unexpected<Error>(Error(render_->source_info().error()));
  }
  return make_agents(*render_->source_info());
}

physics::Result<void> DaemonImpl::make_agents(const SourceInfo& source) {
  auto channels = make_channels(scenario_, source);
  if (!channels) {
    return tl::unexpected<Error>(std::move(channels.error()));
  }
  context_.channels = std::move(*channels);

  const std::string software = fmt::format("emitd {} ({})", kVersion, kCommit);
  const std::string scenario_name = scenario_ ? scenario_->name : std::string();
  const bool slotted = config_.pacing.mode != config::PacingMode::host_step;
  Recorder::Identity identity;
  identity.scenario_name = scenario_name;
  identity.software = software;
  identity.device = source.device;
  identity.pacing = pacing_name(config_.pacing.mode);
  if (scenario_) {
    auto hash = scenario_sha256(*scenario_);
    if (!hash) {
      return tl::unexpected<Error>(std::move(hash.error()));
    }
    identity.scenario_sha256 = std::move(*hash);
  }
  recorder_ = std::make_unique<Recorder>(context_, config_.journal, config_.control.max_clients);
  recorder_->set_identity(std::move(identity));
  if (auto opened = recorder_->open(); !opened) {
    return tl::unexpected<Error>(std::move(opened.error()).with_context("journal.file"));
  }
  receiver_->set_identity(
      {software, scenario_name, std::string(pacing_name(config_.pacing.mode)), source.device});
  // Three slots beside the window: one being rendered, one on its way here, one free.
  const std::uint32_t window =
      std::min(std::max(config_.stream.queue_frames, 1U), std::max(source.slots, 4U) - 3);
  if (!config_.stream.shm.empty()) {
    auto shm =
        ShmClient::create(config_.stream, context_.channels, receiver_->welcome(), clock_.tai_ns());
    if (!shm) {
      return tl::unexpected<Error>(std::move(shm.error()).with_context("stream.shm"));
    }
    shm_ = std::move(*shm);
  }
  sender_ =
      std::make_unique<Sender>(context_, window, config_.control.max_clients, slotted, shm_.get());
  Conductor::Options options;
  options.pacing = config_.pacing;
  options.first_plane = context_.channels.front().plane;
  options.canned = source.canned;
  options.tai_unset = clock_.tai_offset_unset();
  conductor_ = std::make_unique<Conductor>(context_, tracks_, options, triggers_.get());

  log_->write(
      LogLevel::info,
      fmt::format("software=\"{}\" commit={} device=\"{}\" scenario=\"{}\" pacing={} "
                  "channels={} width_px={} height_px={}",
                  software, kCommit, source.device, scenario_ ? scenario_->file.string() : "",
                  pacing_name(config_.pacing.mode), context_.channels.size(), source.width_px,
                  source.height_px));
  if (!privileges_.empty()) {
    log_->write(LogLevel::info, privileges_);
  }
  if (shm_) {
    log_->write(LogLevel::info,
                fmt::format("event=shm url=shm://{} slots={} mode={:04o}", config_.stream.shm,
                            config_.stream.shm_slots, config_.stream.shm_mode));
  }
  if (clock_.tai_offset_unset()) {
    log_->write(LogLevel::warn,
                "event=tai_offset_unset effect=\"wall instants are UTC\" "
                "remedy=\"let ntpd, chronyd or phc2sys set the kernel's TAI offset\"");
  }
  recorder_runner_ = std::make_unique<AgentRunner>(*recorder_, clock_);
  sender_runner_ = std::make_unique<AgentRunner>(*sender_, clock_);
  conductor_runner_ = std::make_unique<AgentRunner>(*conductor_, clock_);
  receiver_runner_ = std::make_unique<AgentRunner>(*receiver_, clock_);
  for (AgentRunner* runner : {recorder_runner_.get(), sender_runner_.get(), conductor_runner_.get(),
                              receiver_runner_.get()}) {
    plan_realtime(*runner);
  }
  if (options_.stepped) {
    for (AgentRunner* runner : {recorder_runner_.get(), sender_runner_.get(),
                                conductor_runner_.get(), receiver_runner_.get()}) {
      if (!runner->start_stepped()) {
        return physics::make_error(ErrorCode::io,
                                   fmt::format("the {} did not start", runner->agent().name()));
      }
    }
  }
  return open_metrics({{"version", kVersion},
                       {"commit", kCommit},
                       {"device", source.device},
                       {"scenario", scenario_name},
                       {"pacing", std::string(pacing_name(config_.pacing.mode))}});
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
  answers.ready = [this] { return serving_.load(std::memory_order_acquire); };
  answers.admits = [this](const SocketAddress& peer) {
    const config::IpAddress ip = ip_of(peer);
    if (receiver_->may_connect(ip)) {
      return true;
    }
    context_.counters.add(Counter::peers_refused);
    context_.metrics_events.push(EventKind::peer_refused,
                                 static_cast<std::uint64_t>(PeerRefusal::not_allowed), 0,
                                 config::to_string(ip));
    return false;
  };
  answers.healthy = [this] {
    constexpr std::int64_t kStuckNs = 5'000'000'000;
    const std::int64_t now_ns = clock_.monotonic_ns();
    return now_ns - housekept_ns_.load(std::memory_order_acquire) < kStuckNs &&
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
  return {context_.run_id.load(std::memory_order_relaxed), serving_.load(std::memory_order_acquire),
          now_ns - started_ns_, now_ns, ptp_ ? std::optional(ptp_->status()) : std::nullopt};
}

physics::Result<void> DaemonImpl::open_clocks() {
  const auto named = [this](const Error& error, const char* key) {
    return tl::unexpected<Error>(
        Error(error).with_context(key).with_context(config_.file.string()));
  };
  if (!config_.clock.ptp_socket.empty()) {
    auto ptp = PtpMonitor::open(config_.clock.ptp_socket,
                                static_cast<std::uint8_t>(config_.clock.ptp_domain));
    if (!ptp) {
      return named(ptp.error(), "clock.ptp_socket");
    }
    ptp_ = std::move(*ptp);
  }
  if (config_.pacing.mode == config::PacingMode::trigger) {
    auto port =
        TriggerPort::open(config_.trigger.udp, config_.trigger.peer, clock_, context_.counters);
    if (!port) {
      return tl::unexpected<Error>(std::move(port.error()).with_context(config_.file.string()));
    }
    triggers_ = std::move(*port);
  }
  return {};
}

physics::Result<void> DaemonImpl::check_realtime() {
  const std::string refused = realtime_.refusals();
  if (refused.empty()) {
    return {};
  }
  if (config_.realtime.required) {
    return physics::make_error(ErrorCode::io,
                               fmt::format("{}: [realtime] is required, but the host refuses: {}",
                                           config_.file.string(), refused));
  }
  log_->write(LogLevel::warn,
              fmt::format("event=realtime_refused what=\"{}\" effect=\"timing is as the host "
                          "schedules other programs\"",
                          refused));
  return {};
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

int DaemonImpl::run() {
  for (AgentRunner* runner : {recorder_runner_.get(), sender_runner_.get(), conductor_runner_.get(),
                              receiver_runner_.get()}) {
    if (!runner->start_thread()) {
      log_->write(LogLevel::error,
                  fmt::format("event=agent_failed agent={}", runner->agent().name()));
      stop_agents();
      return 1;
    }
  }
  serving_.store(true, std::memory_order_release);
  health_.ready(ready_line());
  log_->write(LogLevel::info, ready_line());
  while (!stop_.load(std::memory_order_acquire)) {
    if (context_.device_lost.load(std::memory_order_acquire)) {
      return end_without_device();
    }
    pollfd wait{stop_event_.get(), POLLIN, 0};
    constexpr int kHousekeepingMs = 100;
    ::poll(&wait, 1, kHousekeepingMs);
    housekeep();
    if (const auto stuck = health_.turn(sources_.agents, clock_.monotonic_ns()); !stuck.empty()) {
      log_->write(LogLevel::error, fmt::format("event=agent_stuck agent={} effect=\"frames stop; a "
                                               "watchdog, where there is one, ends the daemon\"",
                                               stuck));
    }
    if (ptp_) {
      watch_ptp();
    }
  }
  serving_.store(false, std::memory_order_release);
  health_.stopping();
  log_->write(LogLevel::info, "event=stopping");
  receiver_->drain();
  context_.bells.receiver.ring();
  conductor_->drain();
  context_.bells.conductor.ring();
  const auto lost = [this] { return context_.device_lost.load(std::memory_order_acquire); };
  const bool frames =
      wait_until([&] { return conductor_->drained() || lost(); }, kFramesDrainNs) && !lost();
  if (lost()) {
    return end_without_device();
  }
  const bool clients = wait_until([this] { return sender_->idle(); }, kClientsDrainNs);
  const bool journal = wait_until([this] { return recorder_->idle(); }, kJournalDrainNs);
  stop_agents();
  housekeep();
  log_summary();
  log_->write(
      LogLevel::info,
      fmt::format("event=stopped frames={} clients={} journal={}", frames ? "drained" : "given_up",
                  clients ? "drained" : "given_up", journal ? "drained" : "given_up"));
  log_->flush();
  return 0;
}

/// What was rendered goes out and into the journal. The render thread is left alone: it may hang in
/// the driver.
int DaemonImpl::end_without_device() {
  serving_.store(false, std::memory_order_release);
  housekeep();
  log_->write(LogLevel::error,
              fmt::format("event=stopping reason=device_lost exit={}", kExitDeviceLost));
  receiver_->drain();
  context_.bells.receiver.ring();
  static_cast<void>(wait_until([this] { return sender_->idle(); }, kLostDrainNs));
  static_cast<void>(wait_until([this] { return recorder_->idle(); }, kLostDrainNs));
  for (AgentRunner* runner : {conductor_runner_.get(), sender_runner_.get(), recorder_runner_.get(),
                              receiver_runner_.get()}) {
    runner->stop();
  }
  housekeep();
  log_summary();
  log_->flush();
  return kExitDeviceLost;
}

template <class Predicate>
bool DaemonImpl::wait_until(Predicate done, std::int64_t limit_ns) {
  const std::int64_t end_ns = clock_.monotonic_ns() + limit_ns;
  while (!done()) {
    if (clock_.monotonic_ns() > end_ns) {
      return false;
    }
    const timespec pause{0, 2'000'000};
    ::nanosleep(&pause, nullptr);
    housekeep();
  }
  return true;
}

int DaemonImpl::step() {
  int work = 0;
  for (AgentRunner* runner :
       {receiver_runner_.get(), conductor_runner_.get(), render_runner_.get(),
        conductor_runner_.get(), sender_runner_.get(), recorder_runner_.get()}) {
    work += runner->step();
  }
  housekeep();
  return work;
}

void DaemonImpl::drain_stepped() {
  receiver_->drain();
  conductor_->drain();
  constexpr int kMaxSteps = 10'000;
  for (int i = 0; i < kMaxSteps && (step() > 0 || !conductor_->drained()); ++i) {
  }
}

void DaemonImpl::stop_agents() {
  // Against the flow of lent things: slots go back to the source before it ends, descriptors to the
  // receiver before it closes them.
  for (AgentRunner* runner : {conductor_runner_.get(), sender_runner_.get(), recorder_runner_.get(),
                              receiver_runner_.get(), render_runner_.get()}) {
    if (runner != nullptr) {
      runner->stop();
    }
  }
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
  housekept_ns_.store(clock_.monotonic_ns(), std::memory_order_release);
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

}  // namespace

physics::Result<std::unique_ptr<Daemon>> Daemon::create(const config::DaemonConfig& config,
                                                        std::optional<scene::ScenarioDesc> scenario,
                                                        DaemonOptions options) {
  auto daemon = std::make_unique<DaemonImpl>(config, std::move(scenario), std::move(options));
  if (auto ready = daemon->setup(); !ready) {
    return tl::unexpected<Error>(std::move(ready.error()));
  }
  return daemon;
}

}  // namespace emit::server
