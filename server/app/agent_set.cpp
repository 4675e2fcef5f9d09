// SPDX-License-Identifier: Apache-2.0
#include "app/agent_set.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "agents/gateway/gateway_setup.hpp"
#include "agents/motion/motion_setup.hpp"
#include "app/recording.hpp"
#include "axes/open_axes_link.hpp"
#include "emit/physics/check.hpp"
#include "emit/v1/control.pb.h"

namespace emit::server {
namespace {

using physics::Error;
using physics::ErrorCode;

/// Returns the slots of a source. A frame takes one for each camera.
std::uint32_t slot_count(const config::DaemonConfig& config,
                         const std::optional<scene::ScenarioDesc>& scenario) {
  const auto cameras =
      static_cast<std::uint32_t>(cameras_of(scenario, config.motion.enabled()).size());
  const auto frames = std::clamp<std::uint32_t>(config.stream.queue_frames + 3, 4, 16);
  return std::min(cameras * frames, static_cast<std::uint32_t>(kMaxSlots));
}

}  // namespace

physics::Result<void> AgentSet::open_receiver() {
  receiver_ = std::make_unique<Receiver>(context_, config_);
  if (auto opened = receiver_->open(); !opened) {
    return tl::unexpected<Error>(std::move(opened.error()).with_context(config_.file.string()));
  }
  return {};
}

FrameSourceFactory AgentSet::configured_source(renderer::WarmUpProgress progress) const {
  if (config_.source.kind == config::SourceKind::canned) {
    return [this] {
      return make_canned_source(config_.source, slot_count(config_, scenario_),
                                scenario_ ? scenario_->bands.size() : 1);
    };
  }
  return [this, progress = std::move(progress)] {
    renderer::DeviceOptions device;
    device.gpu_index = config_.device.gpu_index;
    renderer::OutputOptions output;
    output.slots = slot_count(config_, scenario_);
    const bool deadlines =
        config_.pacing.mode != config::PacingMode::host_step || config_.pacing.budget_ns > 0;
    output.ladder = deadlines ? renderer::Ladder::live : renderer::Ladder::none;
    return make_renderer_source(*scenario_, device, output, config_.source.first_time_ns, progress);
  };
}

physics::Result<void> AgentSet::start_render(FrameSourceFactory factory) {
  render_ = std::make_unique<RenderAgent>(context_, std::move(factory));
  render_runner_ = std::make_unique<AgentRunner>(*render_, context_.clock);
  plan_realtime(*render_runner_);
  const bool started = stepped_ ? render_runner_->start_stepped() : render_runner_->start_thread();
  if (started) {
    return {};
  }
  return render_->source_info()
             ? physics::make_error(ErrorCode::internal, "the render thread did not start")
             : tl::unexpected<Error>(Error(render_->source_info().error()));
}

physics::Result<Recorder::Opened> AgentSet::make_recorder(const ProcessNames& names) {
  Recorder::Identity identity;
  identity.scenario_name = names.scenario;
  identity.software = names.software;
  identity.device = names.device;
  identity.pacing = names.pacing;
  identity.first_time_ns = config_.source.first_time_ns;
  std::optional<ScenarioIdentity> of_scenario;
  if (scenario_) {
    auto identified = identify_scenario(*scenario_);
    if (!identified) {
      return tl::unexpected<Error>(std::move(identified.error()));
    }
    of_scenario = std::move(*identified);
    identity.scenario_sha256 = of_scenario->sha256;
  }
  v1::Recording recording;
  fill(of_scenario ? &*of_scenario : nullptr, &config_, context_.channels, recording);
  recording.SerializeToString(&identity.recording);
  recorder_ = std::make_unique<Recorder>(context_, config_.journal, config_.control.max_clients);
  recorder_->set_identity(std::move(identity));
  if (!config_.console.listen.empty()) {
    journal_tap_ = std::make_unique<JournalTap>(context_.bells.recorder);
    recorder_->set_tap(journal_tap_.get());
  }
  auto opened = recorder_->open();
  if (!opened) {
    return tl::unexpected<Error>(std::move(opened.error()).with_context("journal.file"));
  }
  return opened;
}

physics::Result<void> AgentSet::make_sender() {
  // Three slots beside the window: one is being rendered, one is on its way here, one is free.
  const auto frames = source().slots / static_cast<std::uint32_t>(context_.cameras.size());
  const std::uint32_t window =
      std::min(std::max(config_.stream.queue_frames, 1U), std::max(frames, 4U) - 3);
  if (!config_.stream.shm.empty()) {
    auto shm = ShmClient::create(config_.stream, context_.channels, receiver().welcome(),
                                 context_.clock.tai_ns());
    if (!shm) {
      return tl::unexpected<Error>(std::move(shm.error()).with_context("stream.shm"));
    }
    shm_ = std::move(*shm);
  }
  if (!config_.console.listen.empty()) {
    console_tap_ = std::make_unique<ConsoleTap>(context_);
  }
  std::vector<SenderClient*> residents;
  if (shm_) residents.push_back(shm_.get());
  if (console_tap_) residents.push_back(console_tap_.get());
  const bool slotted = config_.pacing.mode != config::PacingMode::host_step;
  sender_ =
      std::make_unique<Sender>(context_, window, config_.control.max_clients, slotted, residents);
  if (config_.stream.compression) {
    sender_->allow_compression();
  }
  return {};
}

physics::Result<void> AgentSet::make_motion() {
  if (!config_.motion.enabled()) {
    return check_no_shift();
  }
  const auto named = [this](physics::Error& error) {
    return tl::unexpected<Error>(std::move(error).with_context(config_.file.string()));
  };
  auto plan = make_motion_plan(config_, scenario_, context_.channels);
  if (!plan) {
    return named(plan.error());
  }
  auto follower = TableFollower::create(plan->follower);
  if (!follower) {
    return named(follower.error());
  }
  auto link = open_axes_link(config_.motion, context_.counters, context_.motion_events);
  if (!link) {
    return named(link.error());
  }
  motion_plan_ = std::move(*plan);
  if (context_.shifts_pictures) {
    render_->shift_by(*motion_plan_);
  }
  motion_ = std::make_unique<MotionAgent>(context_, std::move(*link), std::move(*follower),
                                          motion_plan_->follower.period_ns);
  return {};
}

physics::Result<void> AgentSet::make_gateway() {
  auto made = make_gateway_agent(context_, config_, scenario_);
  if (!made) {
    return tl::unexpected<Error>(std::move(made.error()).with_context(config_.file.string()));
  }
  gateway_ = std::move(*made);
  return {};
}

physics::Result<void> AgentSet::check_no_shift() const {
  const auto shifted = std::ranges::find_if(context_.channels, [](const Channel& channel) {
    return (channel.output_steps & protocol::kOutputShifted) != 0;
  });
  if (shifted == context_.channels.end()) {
    return {};
  }
  return physics::make_error(
      ErrorCode::config,
      fmt::format("{}: channel '{}' of the scenario has 'apply_shift', which needs [motion]",
                  config_.file.string(), shifted->name));
}

void AgentSet::make_conductor(TriggerInput* triggers) {
  Conductor::Options options;
  options.pacing = config_.pacing;
  options.canned = source().canned;
  options.first_time_ns = config_.source.first_time_ns;
  options.gateway = gateway_ != nullptr;
  options.motion = motion_plan_ ? &*motion_plan_ : nullptr;
  if (scenario_ && !options.canned) {
    options.fov_h_rad = scenario_->sensor.fov_h_rad;
    options.fov_h_min_rad =
        is_view_fixed(context_.cameras) ? options.fov_h_rad : scenario_->sensor.narrowest_fov_rad();
  }
  conductor_ = std::make_unique<Conductor>(context_, tracks_, options, triggers);
}

physics::Result<void> AgentSet::make_runners() {
  EMIT_CHECK(render_runner_ != nullptr);
  recorder_runner_ = std::make_unique<AgentRunner>(recorder(), context_.clock);
  sender_runner_ = std::make_unique<AgentRunner>(sender(), context_.clock);
  conductor_runner_ = std::make_unique<AgentRunner>(conductor(), context_.clock);
  receiver_runner_ = std::make_unique<AgentRunner>(receiver(), context_.clock);
  if (motion_) {
    motion_runner_ = std::make_unique<AgentRunner>(*motion_, context_.clock);
  }
  if (gateway_) {
    gateway_runner_ = std::make_unique<AgentRunner>(*gateway_, context_.clock);
  }
  for (AgentRunner* runner : serving_order()) {
    if (runner == nullptr) {
      continue;
    }
    plan_realtime(*runner);
    if (stepped_ && !runner->start_stepped()) {
      return physics::make_error(ErrorCode::io,
                                 fmt::format("the {} did not start", runner->agent().name()));
    }
  }
  for (AgentRunner* runner : label_order()) {
    if (runner == nullptr) {
      continue;
    }
    duty_cycles_.emplace_back(runner->agent().name(), &runner->duty_cycle());
  }
  return {};
}

std::string_view AgentSet::start_serving() {
  EMIT_CHECK(is_made());
  for (AgentRunner* runner : serving_order()) {
    if (runner != nullptr && !runner->start_thread()) {
      return runner->agent().name();
    }
  }
  return {};
}

int AgentSet::step() {
  EMIT_CHECK(is_made());
  int work = 0;
  for (AgentRunner* runner : step_order()) {
    work += runner != nullptr ? runner->step() : 0;
  }
  return work;
}

void AgentSet::drain_stepped(const std::function<int()>& step) {
  EMIT_CHECK(is_made());
  receiver_->drain();
  conductor_->drain();
  constexpr int kMaxSteps = 10'000;
  for (int i = 0; i < kMaxSteps && (step() > 0 || !conductor_->drained()); ++i) {
  }
}

void AgentSet::stop() {
  stop_without_render();
  if (render_runner_ != nullptr) {
    render_runner_->stop();
  }
}

void AgentSet::stop_without_render() {
  for (AgentRunner* runner : stop_order()) {
    if (runner != nullptr) {
      runner->stop();
    }
  }
}

const SourceInfo& AgentSet::source() const {
  EMIT_CHECK(render_ != nullptr && render_->source_info().has_value());
  return *render_->source_info();
}

Receiver& AgentSet::receiver() const {
  EMIT_CHECK(receiver_ != nullptr);
  return *receiver_;
}

Recorder& AgentSet::recorder() const {
  EMIT_CHECK(recorder_ != nullptr);
  return *recorder_;
}

Sender& AgentSet::sender() const {
  EMIT_CHECK(sender_ != nullptr);
  return *sender_;
}

Conductor& AgentSet::conductor() const {
  EMIT_CHECK(conductor_ != nullptr);
  return *conductor_;
}

void AgentSet::plan_realtime(AgentRunner& runner) const {
  runner.set_realtime(thread_realtime(config_.realtime, runner.agent().name()));
}

}  // namespace emit::server
