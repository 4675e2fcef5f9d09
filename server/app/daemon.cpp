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
#include "app/replay.hpp"
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
      stop_event_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {}

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
                                [this](double done_frac) { return warming_up(done_frac); });
  };
}

bool DaemonImpl::warming_up(double done_frac) {
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
  if (auto started = start_render(); !started) {
    return started;
  }
  return make_agents(*render_->source_info());
}

physics::Result<void> DaemonImpl::open_ports() {
  receiver_ = std::make_unique<Receiver>(context_, config_);
  if (auto opened = receiver_->open(); !opened) {
    return tl::unexpected<Error>(std::move(opened.error()).with_context(config_.file.string()));
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

physics::Result<void> DaemonImpl::start_render() {
  render_ = std::make_unique<RenderAgent>(context_, source_factory());
  render_runner_ = std::make_unique<AgentRunner>(*render_, clock_);
  plan_realtime(*render_runner_);
  const bool started =
      options_.stepped ? render_runner_->start_stepped() : render_runner_->start_thread();
  if (started) {
    return {};
  }
  return render_->source_info()
             ? physics::make_error(ErrorCode::internal, "the render thread did not start")
             : tl::unexpected<Error>(Error(render_->source_info().error()));
}

physics::Result<void> DaemonImpl::make_agents(const SourceInfo& source) {
  auto channels = make_channels(scenario_, source);
  if (!channels) {
    return tl::unexpected<Error>(std::move(channels.error()));
  }
  context_.channels = std::move(channels->channels);
  context_.pictures = std::move(channels->pictures);
  const ProcessNames names{fmt::format("emitd {} ({})", kVersion, kCommit),
                           scenario_ ? scenario_->name : std::string(),
                           std::string(pacing_name(config_.pacing.mode)), source.device};
  receiver_->set_identity({names.software, names.scenario, names.pacing, names.device});
  if (auto made = make_recorder(names); !made) {
    return made;
  }
  if (auto made = make_sender(source); !made) {
    return made;
  }
  Conductor::Options options;
  options.pacing = config_.pacing;
  options.canned = source.canned;
  conductor_ = std::make_unique<Conductor>(context_, tracks_, options, triggers_.get());
  log_start(names, source);
  if (auto made = make_runners(); !made) {
    return made;
  }
  return open_metrics({{"version", kVersion},
                       {"commit", kCommit},
                       {"device", names.device},
                       {"scenario", names.scenario},
                       {"pacing", names.pacing}});
}

physics::Result<void> DaemonImpl::make_recorder(const ProcessNames& names) {
  Recorder::Identity identity;
  identity.scenario_name = names.scenario;
  identity.software = names.software;
  identity.device = names.device;
  identity.pacing = names.pacing;
  if (scenario_) {
    auto hash = scenario_sha256(*scenario_);
    if (!hash) {
      return tl::unexpected<Error>(std::move(hash.error()));
    }
    identity.scenario_sha256 = std::move(*hash);
  }
  recorder_ = std::make_unique<Recorder>(context_, config_.journal, config_.control.max_clients);
  recorder_->set_identity(std::move(identity));
  const auto journal = recorder_->open();
  if (!journal) {
    return tl::unexpected<Error>(Error(journal.error()).with_context("journal.file"));
  }
  log_.journal(*journal);
  return {};
}

physics::Result<void> DaemonImpl::make_sender(const SourceInfo& source) {
  // Three slots beside the window: one is being rendered, one is on its way here, one is free.
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
  const bool slotted = config_.pacing.mode != config::PacingMode::host_step;
  sender_ =
      std::make_unique<Sender>(context_, window, config_.control.max_clients, slotted, shm_.get());
  if (config_.stream.compression) {
    sender_->allow_compression();
  }
  return {};
}

void DaemonImpl::log_start(const ProcessNames& names, const SourceInfo& source) {
  log_.software(names, scenario_ ? scenario_->file : std::filesystem::path(), source);
  log_.scene(source.scene);
  if (!privileges_.empty()) {
    log_.write(LogLevel::info, privileges_);
  }
  if (shm_) {
    log_.shared_memory(config_.stream);
  }
  log_.congestion_control(receiver_->congestion_control());
  log_.tai_offset();
}

physics::Result<void> DaemonImpl::make_runners() {
  recorder_runner_ = std::make_unique<AgentRunner>(*recorder_, clock_);
  sender_runner_ = std::make_unique<AgentRunner>(*sender_, clock_);
  conductor_runner_ = std::make_unique<AgentRunner>(*conductor_, clock_);
  receiver_runner_ = std::make_unique<AgentRunner>(*receiver_, clock_);
  for (AgentRunner* runner : serving_runners()) {
    plan_realtime(*runner);
    if (options_.stepped && !runner->start_stepped()) {
      return physics::make_error(ErrorCode::io,
                                 fmt::format("the {} did not start", runner->agent().name()));
    }
  }
  return {};
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

int DaemonImpl::run() {
  for (AgentRunner* runner : serving_runners()) {
    if (!runner->start_thread()) {
      log_.write(LogLevel::error,
                 fmt::format("event=agent_failed agent={}", runner->agent().name()));
      stop_agents();
      log_.finish(kLogEndNs);
      return 1;
    }
  }
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
  if (const auto stuck = health_.turn(sources_.agents, clock_.monotonic_ns()); !stuck.empty()) {
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
  log_.summary(sources_.agents);
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
  receiver_->drain();
  context_.bells.receiver.ring();
  static_cast<void>(wait_until([this] { return sender_->idle(); }, kLostDrainNs));
  static_cast<void>(wait_until([this] { return recorder_->idle(); }, kLostDrainNs));
  for (AgentRunner* runner : {conductor_runner_.get(), sender_runner_.get(), recorder_runner_.get(),
                              receiver_runner_.get()}) {
    runner->stop();
  }
  housekeep();
  log_.summary(sources_.agents);
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
  // The order is against the flow of what is lent: slots go back to the source before it ends, and
  // descriptors to the receiver before it closes them.
  for (AgentRunner* runner : {conductor_runner_.get(), sender_runner_.get(), recorder_runner_.get(),
                              receiver_runner_.get(), render_runner_.get()}) {
    if (runner != nullptr) {
      runner->stop();
    }
  }
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
