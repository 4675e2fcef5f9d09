// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "agents/conductor/conductor.hpp"

namespace emit::server {

using protocol::EntityStateData;
using protocol::HostFrameData;

int Conductor::take_inputs(std::int64_t now_ns) noexcept {
  int work = take_inputs(context_.host_inputs, now_ns);
  if (work > 0 && context_.of_inputs.end()) {
    context_.bells.receiver.ring();
  }
  const int from_gateway = take_inputs(context_.gateway_inputs, now_ns);
  if (from_gateway > 0 && context_.of_gateway_room.end()) {
    context_.bells.gateway.ring();
  }
  return work + from_gateway + take_inputs(context_.console_inputs, now_ns);
}

int Conductor::take_inputs(SpscRing<HostInput>& inputs, std::int64_t now_ns) noexcept {
  int work = 0;
  constexpr int kMaxPerTurn = 8;
  while (work < kMaxPerTurn) {
    HostInput* input = inputs.front();
    if (input == nullptr) {
      break;
    }
    const bool taken = input->kind == HostInput::Kind::frame ? take_frame(*input, now_ns)
                                                             : take_command(*input, now_ns);
    if (!taken) {
      break;  // waits for frames in work; the inputs behind it keep their order
    }
    inputs.pop();
    ++work;
  }
  return work;
}

bool Conductor::refuse_frame(const HostInput& input, GateVerdict verdict) noexcept {
  const std::uint64_t number = input.frame.frame_number;
  switch (verdict) {
    case GateVerdict::time_backwards:
      refuse(input.origin, StatusCode::time_backwards, number);
      return true;
    case GateVerdict::duplicate_frame:
      refuse(input.origin, StatusCode::duplicate_frame, number);
      return true;
    case GateVerdict::old_run:
      context_.counters.add(Counter::host_frames_old_run);
      refuse(input.origin, StatusCode::not_allowed, number, protocol::kDetailOldRun);
      return true;
    default:
      return false;
  }
}

bool Conductor::take_frame(HostInput& input, std::int64_t now_ns) noexcept {
  HostFrameData& frame = input.frame;
  // Two hosts would turn the run over and over.
  if (options_.gateway && input.origin.kind != Origin::Kind::gateway) {
    refuse(input.origin, StatusCode::not_allowed, frame.frame_number);
    return true;
  }
  const InputGate::Result gate = gate_.check(frame);
  if (refuse_frame(input, gate.verdict)) {
    return true;
  }
  // An input in lock step becomes one frame, so it waits until a frame can be issued. A daemon with
  // slots takes inputs at any time, so that its newest pose is the newest that came.
  if (!slots_ && !can_issue() && !reset_pending_) {
    return false;
  }
  if (gate.verdict == GateVerdict::new_epoch) {
    if (!reset_run(now_ns)) {
      return false;
    }
    context_.counters.add(Counter::host_epochs);
    context_.conductor_events.push(EventKind::host_restarted, frame.run_id);
  }
  gate_.accept(frame);
  drop_unknown_entities(input);
  drop_unknown_parts(input);
  drop_wrong_view(input);
  context_.counters.add(Counter::host_frames_accepted);
  if (gate.missing > 0) {
    context_.counters.add(Counter::host_frames_missing, gate.missing);
  }
  store(frame);
  journal_.host_frame(frame, now_ns);
  if (!slots_) {
    use_pose(input);
  }
  return true;
}

void Conductor::use_pose(const HostInput& input) noexcept {
  if (control_.running()) {
    issue_pose(false, input.frame.received_ns);
    return;
  }
  // A host in lock step waits for a frame or for an answer.
  reply(input.origin, StatusCode::ok, input.frame.frame_number,
        context_.counters.add(Counter::host_frames_unused), protocol::kDetailStopped);
}

void Conductor::store(const HostFrameData& frame) noexcept {
  input_ = {frame.frame_number, frame.sim_time_ns, frame.received_ns, true};
  seeker_.push({frame.sim_time_ns, frame.seeker, frame.seeker_rates, false});
  prediction_.compare(seeker_, [this](const PredictionError& error) {
    context_.prediction.record(error.position_m, error.attitude_rad);
  });
  for (const EntityStateData& state : frame.entity_span()) {
    entities_.store(state, frame.sim_time_ns, !slots_);
  }
  // The axes of a run that is stopped park when no poses come. Where the target went meanwhile must
  // not get lost.
  if (motion_) {
    motion_->take_target(frame);
    if (control_.running()) {
      motion_->take_pose(frame);
    }
  }
  if (frame.fov_h_rad) fov_h_rad_ = *frame.fov_h_rad;
  if (frame.gimbal_rad) body_from_detector_ = physics::body_from_turned(*frame.gimbal_rad);
  for (const protocol::PartCommandData& part : frame.part_span()) {
    parts_[part_count_++] = timed_part(part, frame.sim_time_ns);  // drop_unknown_parts() left room
  }
  if (frame.environment) {
    store_weather(*frame.environment, frame.sim_time_ns);
  }
}

void Conductor::store_weather(const protocol::EnvironmentData& environment,
                              std::int64_t sim_time_ns) noexcept {
  if (weather_count_ == weather_.size()) {
    // Replay leaves out the same ones (JournalPlayer).
    --weather_count_;
    context_.counters.add(Counter::weather_coalesced);
  }
  weather_[weather_count_++] = weather_sample(environment, sim_time_ns);
}

void Conductor::drop_unknown_entities(HostInput& input) noexcept {
  HostFrameData& frame = input.frame;
  std::uint32_t kept = 0;
  for (std::uint32_t i = 0; i < frame.entity_count; ++i) {
    const EntityStateData& state = frame.entities[i];
    if (!scenario_.knows(state.entity_id)) {
      refuse(input.origin, StatusCode::unknown_entity, frame.frame_number, state.entity_id);
      continue;
    }
    if (!entities_.add(state.entity_id)) {
      refuse(input.origin, StatusCode::overloaded, frame.frame_number, state.entity_id);
      continue;
    }
    if (kept != i) {
      frame.entities[kept] = state;
    }
    ++kept;
  }
  frame.entity_count = kept;
}

void Conductor::drop_unknown_parts(HostInput& input) noexcept {
  HostFrameData& frame = input.frame;
  std::uint32_t kept = 0;
  for (std::uint32_t i = 0; i < frame.part_count; ++i) {
    const protocol::PartCommandData part = frame.parts[i];
    const TimedPart timed = timed_part(part, frame.sim_time_ns);
    if (!scenario_.takes(part.entity_id, part.part_id, timed.update.command.kind)) {
      refuse(input.origin, StatusCode::unknown_part, frame.frame_number,
             protocol::part_detail(part.entity_id, part.part_id));
      continue;
    }
    if (part_count_ + kept == parts_.size()) {
      refuse(input.origin, StatusCode::overloaded, frame.frame_number, part.entity_id);
      continue;
    }
    frame.parts[kept++] = part;
  }
  frame.part_count = kept;
}

void Conductor::drop_wrong_view(HostInput& input) noexcept {
  std::optional<double>& fov_h_rad = input.frame.fov_h_rad;
  constexpr double kSlackFrac = 1e-6;  // hosts round
  if (!fov_h_rad || (*fov_h_rad >= (1.0 - kSlackFrac) * options_.fov_h_min_rad &&
                     *fov_h_rad <= (1.0 + kSlackFrac) * options_.fov_h_rad)) {
    return;
  }
  fov_h_rad.reset();
  refuse(input.origin, StatusCode::invalid_view, input.frame.frame_number);
}

bool Conductor::take_command(const HostInput& input, std::int64_t now_ns) noexcept {
  const CommandKind command = input.command;
  const bool immediate_step = command == CommandKind::step && !slots_;
  if (immediate_step && input_.came && !can_issue()) {
    return false;
  }
  if (command == CommandKind::reset && (!ledger_.idle() || context_.jobs.claim() == nullptr)) {
    reset_pending_ = true;  // no further frames until those in work are done
    return false;
  }
  // A host-step daemon has nothing to step to before the first pose.
  if ((immediate_step && !input_.came) || !control_.apply(command)) {
    refuse(input.origin, StatusCode::not_allowed, 0, static_cast<std::uint64_t>(command));
    return true;
  }
  journal_.command(command, now_ns);
  context_.run.running.store(control_.running(), std::memory_order_relaxed);
  context_.run.held.store(control_.held(), std::memory_order_relaxed);
  if (command == CommandKind::reset) {
    gate_.reset();
    if (slots_) {
      slots_->reset();
    }
    static_cast<void>(reset_run(now_ns));  // room and idleness were checked above
    if (motion_) {
      motion_->reset();
    }
    if (options_.gateway) {
      report({GatewayReport::Kind::reset, 0});
    }
  } else if (immediate_step) {
    // The pose may be old; the frame was asked for now.
    issue_pose(true, now_ns);
  }
  context_.counters.add(Counter::commands);
  context_.conductor_events.push(EventKind::command, static_cast<std::uint64_t>(command));
  reply(input.origin, StatusCode::ok, 0, context_.counters.get(Counter::commands),
        static_cast<std::uint64_t>(command));
  return true;
}

void Conductor::refuse(const Origin& origin, StatusCode code, std::uint64_t host_frame_number,
                       std::uint64_t detail) noexcept {
  const std::uint64_t count = context_.counters.add(counter_of(code));
  context_.conductor_events.push(
      EventKind::refused, static_cast<std::uint64_t>(code), count,
      detail == protocol::kDetailOldRun ? "a host frame of a replaced run" : "");
  reply(origin, code, host_frame_number, count, detail);
}

void Conductor::reply(const Origin& origin, StatusCode code, std::uint64_t host_frame_number,
                      std::uint64_t count, std::uint64_t detail) noexcept {
  if (origin.kind == Origin::Kind::none) {
    return;
  }
  if (origin.kind == Origin::Kind::gateway) {
    report_input(code, host_frame_number, detail);
    return;
  }
  if (origin.kind == Origin::Kind::console) {
    // One that its console does not take in time is missed by the eye alone.
    if (!context_.console_replies.push({origin, code, host_frame_number, count, detail})) {
      context_.counters.add(Counter::statuses_suppressed);
    }
    context_.bells.console.ring();
    return;
  }
  if (!context_.replies.push({origin, code, host_frame_number, count, detail})) {
    context_.counters.add(Counter::statuses_suppressed);
    return;
  }
  context_.bells.receiver.ring();
}

void Conductor::report_input(StatusCode code, std::uint64_t host_frame_number,
                             std::uint64_t detail) noexcept {
  // Entities, parts and views that are refused do not keep the image from coming.
  if (code == StatusCode::unknown_entity || code == StatusCode::overloaded ||
      code == StatusCode::invalid_view || code == StatusCode::unknown_part) {
    return;
  }
  const bool unused = code == StatusCode::ok && detail == protocol::kDetailStopped;
  report({unused ? GatewayReport::Kind::unused : GatewayReport::Kind::refused, host_frame_number});
}

void Conductor::report(const GatewayReport& report) noexcept {
  if (!context_.gateway_reports.push(report)) {
    context_.counters.add(Counter::gateway_reports_dropped);
    return;
  }
  context_.bells.gateway.ring();
}

}  // namespace emit::server
