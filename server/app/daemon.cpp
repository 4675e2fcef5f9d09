// SPDX-License-Identifier: Apache-2.0
#include "app/daemon.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>

#include <algorithm>
#include <ctime>
#include <filesystem>

#include "app/daemon_impl.hpp"
#include "app/privileges.hpp"
#include "app/recording.hpp"
#include "emit/version.hpp"
#include "net/key_file.hpp"

namespace emit::server {
namespace {

using physics::Error;
using physics::ErrorCode;

// Limits of an end in order. A frame in work may be a slow one (a software renderer takes seconds);
// a client that does not read is given up soon.
constexpr std::int64_t kFramesDrainNs = 60'000'000'000;
constexpr std::int64_t kClientsDrainNs = 2'000'000'000;
constexpr std::int64_t kJournalDrainNs = 5'000'000'000;
/// Limit of each step after the device was lost: a new process is wanted soon.
constexpr std::int64_t kLostDrainNs = 300'000'000;
constexpr std::int64_t kLogEndNs = 2'000'000'000;

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

}  // namespace

DaemonImpl::DaemonImpl(const config::DaemonConfig& config,
                       std::optional<scene::ScenarioDesc> scenario, DaemonOptions options)
    : config_(config),
      scenario_(std::move(scenario)),
      options_(std::move(options)),
      clock_(options_.clock != nullptr ? *options_.clock : system_clock_),
      tracks_(scenario_),
      context_(clock_, journal_bytes(config_.journal),
               std::max<std::size_t>(config_.control.max_clients, 1)),
      log_(context_),
      stop_event_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)),
      agents_(context_, config_, scenario_, tracks_, options_.stepped) {}

FrameSourceFactory DaemonImpl::source_factory() {
  if (options_.source_factory) {
    return options_.source_factory;
  }
  return agents_.configured_source([this](double done_frac) { return warming_up(done_frac); });
}

bool DaemonImpl::warming_up(double done_frac) {
  liveness_.warmed_up_frac.store(done_frac, std::memory_order_relaxed);
  log_.warming_up(done_frac);
  return health_.warming_up(done_frac);
}

physics::Result<void> DaemonImpl::setup() {
  liveness_.start(clock_.monotonic_ns());
  if (!scenario_ && !options_.source_factory &&
      config_.source.kind == config::SourceKind::renderer) {
    return physics::make_error(ErrorCode::config,
                               config_.file.string() + ": a renderer needs a scenario");
  }
  health_.starting();
  if (auto opened = open_clocks(); !opened) {
    return opened;
  }
  // The ports are opened first: an address in use shows at once, not after a scene was loaded.
  if (auto opened = open_ports(); !opened) {
    return opened;
  }
  if (auto opened = log_.open(config_.log, options_.on_log); !opened) {
    return opened;
  }
  if (!options_.stepped) {
    // Ask with the privileges that stay, and before anything large is made, so that it comes from
    // memory that is locked.
    std::vector<std::string_view> more_agents;
    if (config_.motion.enabled()) more_agents.emplace_back("motion");
    if (config_.has_gateway()) more_agents.emplace_back("gateway");
    realtime_ = ask_for_realtime(config_.realtime, more_agents);
    if (auto checked = check_realtime(); !checked) {
      return checked;
    }
  }
  if (!config_.stream.shm.empty()) {
    if (auto free = check_shm_name_free(config_.stream.shm); !free) {
      return tl::unexpected<Error>(std::move(free.error()).with_context("stream.shm"));
    }
  }
  if (scenario_ && config_.source.kind == config::SourceKind::renderer) {
    if (auto checked = check_outputs(*scenario_); !checked) {
      return checked;
    }
    if (auto checked = check_look_ahead(*scenario_, config_); !checked) {
      return checked;
    }
  }
  if (auto opened = open_endpoint(); !opened) {
    return opened;
  }
  log_.write(LogLevel::info,
             fmt::format("event=listening software=\"{}\" {}", build_text("emitd"), addresses()));
  if (auto started = agents_.start_render(source_factory()); !started) {
    return started;
  }
  return make_agents();
}

physics::Result<void> DaemonImpl::open_ports() {
  if (auto opened = agents_.open_receiver(); !opened) {
    return opened;
  }
  if (options_.drop_privileges) {
    // Privileges are dropped while this thread is the only one, because each thread has its own.
    auto dropped = drop_privileges();
    if (!dropped) {
      return tl::unexpected<Error>(std::move(dropped.error()));
    }
    privileges_ = std::move(*dropped);
  }
  return {};
}

physics::Result<void> DaemonImpl::make_agents() {
  const SourceInfo& source = agents_.source();
  auto channels = make_channels(scenario_, source, config_.motion.enabled());
  if (!channels) {
    return tl::unexpected<Error>(std::move(channels.error()));
  }
  context_.channels = std::move(channels->channels);
  context_.pictures = std::move(channels->pictures);
  context_.cameras = std::move(channels->cameras);
  context_.shifts_pictures =
      std::ranges::any_of(context_.pictures, [](const Picture& each) { return each.shifts(); });
  const ProcessNames names{build_text("emitd"), scenario_ ? scenario_->name : std::string(),
                           std::string(pacing_name(config_.pacing.mode)), source.device};
  agents_.receiver().set_identity({names.software, names.scenario, names.pacing, names.device});
  auto journal = agents_.make_recorder(names);
  if (!journal) {
    return tl::unexpected<Error>(std::move(journal.error()));
  }
  log_.journal(*journal);
  if (auto made = agents_.make_sender(); !made) {
    return made;
  }
  if (auto made = agents_.make_motion(); !made) {
    return made;
  }
  if (auto made = agents_.make_gateway(); !made) {
    return made;
  }
  agents_.make_conductor(triggers_.get());
  log_start(names);
  if (auto made = agents_.make_runners(); !made) {
    return made;
  }
  if (endpoint_) {
    endpoint_->serve(agents_.duty_cycles(), build_labels(names));
  }
  return open_console(names);
}

MetricsText::Labels DaemonImpl::build_labels(const ProcessNames& names) {
  return {{"version", kVersion},
          {"commit", kCommit},
          {"device", names.device},
          {"scenario", names.scenario},
          {"pacing", names.pacing}};
}

physics::Result<void> DaemonImpl::open_endpoint() {
  const MetricsEndpoint::Parts parts{context_,
                                     liveness_,
                                     log_.board(),
                                     realtime_,
                                     agents_.receiver(),
                                     ptp_.get(),
                                     config_.motion.enabled()};
  // The device is not known before the source is made.
  const ProcessNames names{build_text("emitd"),
                           scenario_ ? scenario_->name : std::string(),
                           std::string(pacing_name(config_.pacing.mode)),
                           {}};
  auto opened = MetricsEndpoint::open(config_, parts, build_labels(names));
  if (!opened) {
    return tl::unexpected<Error>(std::move(opened.error()));
  }
  endpoint_ = std::move(*opened);
  return {};
}

physics::Result<void> DaemonImpl::open_console(const ProcessNames& names) {
  ConsoleTap* tap = agents_.console_tap();
  if (tap == nullptr) {
    return {};
  }
  ConsoleFacts facts;
  facts.software = names.software;
  facts.scenario = names.scenario;
  facts.pacing = names.pacing;
  facts.device = names.device;
  const bool host_step = config_.pacing.mode == config::PacingMode::host_step;
  facts.rate_hz = host_step ? 0.0 : config_.pacing.rate_hz;
  facts.budget_ns = config_.pacing.budget_ns;
  facts.image_rate_hz = config_.console.rate_hz;
  facts.motion = config_.motion.enabled();
  if (!scenario_ || config_.source.kind != config::SourceKind::renderer) {
    facts.no_explanation = "only rendered scenes can be explained";
  } else if (options_.explain_command.empty()) {
    facts.no_explanation = "the program emit, which explains pixels, is not beside emitd";
  }
  const ConsoleEndpoint::Parts parts{
      context_,  *tap,         *agents_.journal_tap(), options_.explain_command,
      liveness_, log_.board(), agents_.receiver(),     agents_.duty_cycles()};
  auto opened = ConsoleEndpoint::open(config_, parts, std::move(facts));
  if (!opened) {
    return tl::unexpected<Error>(std::move(opened.error()));
  }
  console_ = std::move(*opened);
  return {};
}

void DaemonImpl::log_start(const ProcessNames& names) {
  const SourceInfo& source = agents_.source();
  log_.software(names, scenario_ ? scenario_->file : std::filesystem::path(), source);
  log_.scene(source.scene);
  log_.outputs(context_.channels, context_.pictures);
  if (!privileges_.empty()) {
    log_.write(LogLevel::info, privileges_);
  }
  if (const GatewayAgent* gateway = agents_.gateway()) {
    log_.write(LogLevel::info, fmt::format("event=gateway listen={} {}",
                                           to_string(gateway->address()), gateway->notes()));
  }
  if (!config_.stream.shm.empty()) {
    log_.shared_memory(config_.stream);
  }
  log_.congestion_control(agents_.receiver().congestion_control());
  log_.tai_offset();
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
    std::vector<protocol::SessionKey> keys;
    if (!config_.host.key_file.empty()) {
      auto read = read_key_file(config_.host.key_file);
      if (!read) {
        return named(read.error(), "host.key_file");
      }
      keys = std::move(*read);
    }
    auto port = TriggerPort::open(config_.trigger.udp, config_.trigger.peer, keys, clock_,
                                  context_.counters);
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
  log_.warn(
      fmt::format("event=realtime_refused what=\"{}\" effect=\"timing is as the host "
                  "schedules other programs\"",
                  refused));
  return {};
}

std::string DaemonImpl::ready_line() const {
  return "ready " + addresses();
}

std::string DaemonImpl::addresses() const {
  const SocketAddress host = agents_.receiver().host_address();
  return fmt::format("control={} host_udp={}{}{}{}",
                     to_string(agents_.receiver().control_address()),
                     host.length != 0 ? to_string(host) : std::string("off"),
                     triggers_ ? " trigger=" + to_string(triggers_->address()) : std::string(),
                     console_ ? " console=" + console_->url() : std::string(),
                     endpoint_ ? " metrics=" + to_string(endpoint_->address()) : std::string());
}

int DaemonImpl::run() {
  if (const std::string_view failed = agents_.start_serving(); !failed.empty()) {
    log_.write(LogLevel::error, fmt::format("event=agent_failed agent={}", failed));
    agents_.stop();
    log_.finish(kLogEndNs);
    return 1;
  }
  liveness_.warmed_up_frac.store(1.0, std::memory_order_relaxed);
  liveness_.serving.store(true, std::memory_order_release);
  health_.ready(ready_line());
  log_.write(LogLevel::info, ready_line());
  while (!stop_.load(std::memory_order_acquire)) {
    if (context_.device_lost.load(std::memory_order_acquire)) {
      return end_without_device();
    }
    watch_once();
  }
  return end_in_order();
}

void DaemonImpl::watch_once() {
  pollfd wait{stop_event_.get(), POLLIN, 0};
  constexpr int kHousekeepingMs = 100;
  ::poll(&wait, 1, kHousekeepingMs);
  housekeep();
  if (const auto stuck = health_.turn(agents_.duty_cycles(), clock_.monotonic_ns());
      !stuck.empty()) {
    log_.write(LogLevel::error, fmt::format("event=agent_stuck agent={} effect=\"frames stop; a "
                                            "watchdog, where there is one, ends the daemon\"",
                                            stuck));
  }
  if (ptp_) {
    log_.ptp(ptp_->turn(clock_.monotonic_ns()), *ptp_);
  }
}

/// Finishes the frames in work, lets clients read and closes the journal, each within its limit.
int DaemonImpl::end_in_order() {
  liveness_.serving.store(false, std::memory_order_release);
  health_.stopping();
  log_.write(LogLevel::info, "event=stopping");
  agents_.receiver().drain();
  context_.bells.receiver.ring();
  agents_.conductor().drain();
  context_.bells.conductor.ring();
  const auto lost = [this] { return context_.device_lost.load(std::memory_order_acquire); };
  const bool frames =
      wait_until([&] { return agents_.conductor().drained() || lost(); }, kFramesDrainNs) &&
      !lost();
  if (lost()) {
    return end_without_device();
  }
  const bool clients = wait_until([this] { return agents_.sender().idle(); }, kClientsDrainNs);
  const bool journal = wait_until([this] { return agents_.recorder().idle(); }, kJournalDrainNs);
  agents_.stop();
  housekeep();
  log_.summary(agents_.duty_cycles());
  log_.write(
      LogLevel::info,
      fmt::format("event=stopped frames={} clients={} journal={}", frames ? "drained" : "given_up",
                  clients ? "drained" : "given_up", journal ? "drained" : "given_up"));
  log_.finish(kLogEndNs);
  return 0;
}

/// Sends and records what was rendered. The render thread is left alone: it may hang in the driver.
int DaemonImpl::end_without_device() {
  liveness_.serving.store(false, std::memory_order_release);
  housekeep();
  log_.write(LogLevel::error,
             fmt::format("event=stopping reason=device_lost exit={}", kExitDeviceLost));
  agents_.receiver().drain();
  context_.bells.receiver.ring();
  static_cast<void>(wait_until([this] { return agents_.sender().idle(); }, kLostDrainNs));
  static_cast<void>(wait_until([this] { return agents_.recorder().idle(); }, kLostDrainNs));
  agents_.stop_without_render();
  housekeep();
  log_.summary(agents_.duty_cycles());
  log_.finish(kLostDrainNs);
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

void DaemonImpl::housekeep() {
  log_.housekeep();
  liveness_.housekept_ns.store(clock_.monotonic_ns(), std::memory_order_release);
}

int DaemonImpl::step() {
  const int work = agents_.step();
  housekeep();
  return work;
}

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
