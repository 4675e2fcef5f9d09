// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "agents/conductor/conductor.hpp"

namespace emit::server {

using protocol::EntityStateData;
using protocol::HostFrameData;

int Conductor::take_inputs(std::int64_t now_ns) noexcept {
  int work = 0;
  constexpr int kMaxPerTurn = 8;
  while (work < kMaxPerTurn) {
    HostInput* input = context_.host_inputs.front();
    if (input == nullptr) {
      break;
    }
    const bool taken = input->kind == HostInput::Kind::frame ? take_frame(*input, now_ns)
                                                             : take_command(*input, now_ns);
    if (!taken) {
      break;  // waits for frames in work; the inputs behind it keep their order
    }
    context_.host_inputs.pop();
    if (context_.of_inputs.end()) {
      context_.bells.receiver.ring();
    }
    ++work;
  }
  return work;
}

bool Conductor::take_frame(HostInput& input, std::int64_t now_ns) noexcept {
  HostFrameData& frame = input.frame;
  InputGate::Result gate = gate_.check(frame);
  if (gate.verdict == GateVerdict::time_backwards) {
    refuse(input.origin, StatusCode::time_backwards, frame.frame_number);
    return true;
  }
  if (gate.verdict == GateVerdict::duplicate_frame) {
    refuse(input.origin, StatusCode::duplicate_frame, frame.frame_number);
    return true;
  }
  if (gate.verdict == GateVerdict::old_run) {
    context_.counters.add(Counter::host_frames_old_run);
    refuse(input.origin, StatusCode::not_allowed, frame.frame_number, protocol::kDetailOldRun);
    return true;
  }
  // In lock step each input becomes a frame. With slots emitd takes inputs at any time,
  // so that the newest pose known is the newest that came.
  if (!slotted() && !can_issue() && !reset_pending_) {
    return false;
  }
  if (gate.verdict == GateVerdict::new_epoch) {
    if (!reset_run(now_ns)) {
      return false;
    }
    context_.counters.add(Counter::host_epochs);
    context_.conductor_events.push(EventKind::host_epoch, frame.run_id);
  }
  gate_.accept(frame);
  drop_unknown_entities(input);
  context_.counters.add(Counter::host_frames_accepted);
  if (gate.missing > 0) {
    context_.counters.add(Counter::host_frames_missing, gate.missing);
  }
  remember(frame);
  journal_host_frame(frame, now_ns);
  if (!slotted()) {
    if (control_.running()) {
      issue_host_step(false, frame.received_ns);
    } else {
      context_.counters.add(Counter::host_frames_unused);
    }
  }
  return true;
}

void Conductor::remember(const HostFrameData& frame) noexcept {
  have_host_frame_ = true;
  host_frame_number_ = frame.frame_number;
  host_sim_time_ns_ = frame.sim_time_ns;
  host_received_ns_ = frame.received_ns;
  seeker_.push({frame.sim_time_ns, frame.seeker, frame.seeker_rates, false});
  prediction_.compare(seeker_, [this](const PredictionError& error) {
    context_.prediction.record(error.position_m, error.attitude_rad);
  });
  for (const EntityStateData& state : frame.entity_span()) {
    remember_entity(state, frame.sim_time_ns);
  }
  if (frame.environment) {
    remember_weather(*frame.environment, frame.sim_time_ns);
  }
}

void Conductor::remember_entity(const EntityStateData& state, std::int64_t sim_time_ns) noexcept {
  Entity* found = entity(state.entity_id);
  if (found == nullptr) {
    return;  // drop_unknown_entities() made room for each that is left
  }
  Entity& body = *found;
  body.on = state.on;
  if (state.has_pose) {
    body.track.push({sim_time_ns, state.pose, state.rates, state.teleport});
    if (state.teleport) {
      if (!body.teleport_pending) {
        body.first_teleport_ns = sim_time_ns;
      }
      body.last_teleport_ns = sim_time_ns;
      body.teleport_pending = true;
    }
  } else {
    // It stays where it is: where a host put it last, else where the scenario has it at this
    // instant. For the track that ends any motion; it is no jump of the entity.
    const physics::Pose pose = body.track.empty() ? scenario_.entity_at(body.id, sim_time_ns).pose
                                                  : body.track.newest().pose;
    constexpr bool kNoMotionBefore = true;
    body.track.push({sim_time_ns, pose, std::nullopt, kNoMotionBefore});
  }
  if (!body.touched && !slotted()) {
    body.touched = true;
    touched_.push_back(body.id);
  }
}

void Conductor::remember_weather(const protocol::EnvironmentData& environment,
                                 std::int64_t sim_time_ns) noexcept {
  if (weather_count_ == weather_.size()) {
    // Replay leaves out the same ones (JournalPlayer).
    --weather_count_;
    context_.counters.add(Counter::weather_coalesced);
  }
  weather_[weather_count_++] = {sim_time_ns,
                                environment.direct_normal_w_m2,
                                environment.diffuse_horizontal_w_m2,
                                environment.longwave_down_w_m2,
                                environment.air_k,
                                environment.wind_m_s,
                                environment.cloud_frac,
                                environment.environment_k,
                                environment.film_w_m2_k};
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
    if (entity(state.entity_id) == nullptr) {
      if (entities_.size() == kMaxTracked) {
        refuse(input.origin, StatusCode::overloaded, frame.frame_number, state.entity_id);
        continue;
      }
      Entity added;
      added.id = state.entity_id;
      const auto place =
          std::lower_bound(entities_.begin(), entities_.end(), added.id,
                           [](const Entity& a, std::uint32_t id) { return a.id < id; });
      entities_.insert(place, added);  // within what was reserved
    }
    if (kept != i) {
      frame.entities[kept] = state;
    }
    ++kept;
  }
  frame.entity_count = kept;
}

Conductor::Entity* Conductor::entity(std::uint32_t id) noexcept {
  const auto found = std::lower_bound(entities_.begin(), entities_.end(), id,
                                      [](const Entity& a, std::uint32_t b) { return a.id < b; });
  return found != entities_.end() && found->id == id ? &*found : nullptr;
}

bool Conductor::take_command(const HostInput& input, std::int64_t now_ns) noexcept {
  const CommandKind command = input.command;
  const bool immediate_step = command == CommandKind::step && !slotted();
  if (immediate_step && have_host_frame_ && !can_issue()) {
    return false;
  }
  if (command == CommandKind::reset && (issued_count_ > 0 || context_.jobs.claim() == nullptr)) {
    reset_pending_ = true;  // no further frames until those in work are done
    return false;
  }
  // A host-step daemon has nothing to step to before the first pose.
  if ((immediate_step && !have_host_frame_) || !control_.apply(command)) {
    refuse(input.origin, StatusCode::not_allowed, 0, static_cast<std::uint64_t>(command));
    return true;
  }
  JournalCommand line;
  line.head = {0, now_ns, JournalKind::command};
  line.command = command;
  if (!journal_.write(line)) {
    count_lost_line();
  }
  context_.bells.recorder.ring();
  if (command == CommandKind::reset) {
    gate_.reset();
    trigger_.forget_source();
    static_cast<void>(reset_run(now_ns));  // room and idleness were checked above
  } else if (immediate_step) {
    // The pose may be old; the frame was asked for now.
    issue_host_step(true, now_ns);
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
  if (!context_.replies.push({origin, code, host_frame_number, count, detail})) {
    context_.counters.add(Counter::statuses_suppressed);
    return;
  }
  context_.bells.receiver.ring();
}

void Conductor::journal_host_frame(const HostFrameData& frame, std::int64_t now_ns) noexcept {
  JournalHostFrame line;
  line.head = {0, now_ns, JournalKind::host_frame};
  line.frame_number = frame.frame_number;
  line.sim_time_ns = frame.sim_time_ns;
  line.run_id = frame.run_id;
  line.received_ns = frame.received_ns;
  line.seeker = frame.seeker;
  line.seeker_rates = frame.seeker_rates;
  line.environment = frame.environment;
  line.entity_count = frame.entity_count;
  if (!journal_.write(line, frame.entity_span())) {
    count_lost_line();
  }
  context_.bells.recorder.ring();
}

}  // namespace emit::server
