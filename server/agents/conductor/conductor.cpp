// SPDX-License-Identifier: Apache-2.0
#include "agents/conductor/conductor.hpp"

#include <algorithm>

namespace emit::server {

using protocol::FrameHeader;

Conductor::Conductor(Context& context, const ScenarioTracks& scenario, const Options& options,
                     TriggerInput* triggers)
    : Agent(context.bells.conductor),
      context_(context),
      scenario_(scenario),
      options_(options),
      journal_(context),
      ledger_(context),
      entities_(scenario),
      slots_(make_slot_source(context, options.pacing, triggers)) {
  if (options.motion != nullptr) {
    motion_.emplace(context, scenario, *options.motion);
  }
}

bool Conductor::on_start() noexcept {
  start_run(context_.clock.tai_ns());
  return true;
}

std::int64_t Conductor::wake_at_ns() const noexcept {
  return slots_ && !draining_.load(std::memory_order_relaxed) ? slots_->wake_at_ns() : kNeverNs;
}

int Conductor::wait_fd() const noexcept {
  // Nobody reads it while draining, and what waits there must not wake the agent over and over.
  return slots_ && !draining_.load(std::memory_order_relaxed) ? slots_->fd() : -1;
}

int Conductor::do_work(std::int64_t now_ns) noexcept {
  if (slots_ && !draining()) {
    slots_->poll(now_ns);
  }
  if (motion_) {
    motion_->take_reports();
  }
  int work = take_images_and_slots(now_ns);
  if (draining()) {
    if (ledger_.idle()) {
      drained_.store(true, std::memory_order_release);
    }
    return work;
  }
  work += take_inputs(now_ns);
  // Slots begin after the inputs are taken, so that the frame shows the newest pose.
  if (slots_ && slots_->begin(now_ns)) {
    begin_slot();
    ++work;
  }
  return work;
}

void Conductor::start_run(std::int64_t now_ns) noexcept {
  const std::uint64_t run_id = ledger_.begin_run(now_ns);
  control_.new_run();
  weather_count_ = 0;
  part_count_ = 0;
  seeker_.clear();
  prediction_.clear();
  entities_.clear();
  input_ = {};
  fov_h_rad_ = options_.fov_h_rad;
  body_from_detector_ = glm::dquat(1.0, 0.0, 0.0, 0.0);
  last_sim_time_ns_ = 0;
  issued_any_ = false;
  slot_policy_.reset();
  if (motion_) {
    motion_->start_run();
  }
  context_.run_id.store(run_id, std::memory_order_relaxed);
  journal_.run_start(run_id, now_ns);
  context_.conductor_events.push(EventKind::run_started, run_id);
}

bool Conductor::reset_run(std::int64_t now_ns) noexcept {
  reset_pending_ = true;
  RenderJob* job = context_.jobs.claim();
  if (!ledger_.idle() || job == nullptr) {
    return false;
  }
  reset_pending_ = false;
  job->kind = RenderJob::Kind::reset;
  context_.jobs.commit();
  context_.bells.render.ring();
  start_run(now_ns);
  return true;
}

bool Conductor::can_issue() noexcept {
  return !ledger_.full() && context_.jobs.claim() != nullptr && !reset_pending_;
}

void Conductor::issue_pose(bool is_step, std::int64_t received_ns) noexcept {
  RenderJob& job = context_.jobs.claim_reserved();
  FrameLedger::Issued& issued = ledger_.next();
  job.kind = RenderJob::Kind::frame;
  job.entity_count = 0;
  job.request.sim_time_ns = input_.sim_time_ns;
  job.request.sensor_pose = seeker_.newest().pose;
  issued.entities_behind = !entities_.add_marked(job);
  issued.header.pose_sim_time_ns = input_.sim_time_ns;
  issued.header.host_received_ns = received_ns;
  if (options_.pacing.budget_ns > 0) {
    issued.header.deadline_ns = received_ns + options_.pacing.budget_ns;
  }
  issue(job, issued, is_step);
}

void Conductor::issue_slot() noexcept {
  RenderJob& job = context_.jobs.claim_reserved();
  FrameLedger::Issued& issued = ledger_.next();
  job.kind = RenderJob::Kind::frame;
  job.entity_count = 0;
  const SlotSource::Slot& slot = slots_->slot();
  issued.header.deadline_ns = slot.deadline_ns;
  issued.header.slot_begin_ns = slot.begin_ns;
  issued.header.trigger_number = slot.trigger_number;
  issued.header.flags |= slots_->take_flags();
  issued.header.host_received_ns = input_.received_ns;
  if (input_.came) {
    place_at_slot(job, issued);
  } else {
    show_start(job, issued);
  }
  slot_policy_.issued();
  issue(job, issued, control_.step_pending());
}

void Conductor::show_start(RenderJob& job, FrameLedger::Issued& issued) const noexcept {
  // The surface is warmed up for this instant.
  job.request.sim_time_ns = options_.first_time_ns;
  job.request.sensor_pose = scenario_.sensor_at(options_.first_time_ns);
  // The frame says that no host steers it, unless it is a canned one, which no pose would change.
  issued.header.flags |= options_.canned ? 0U : protocol::kFlagStale;
}

void Conductor::place_at_slot(RenderJob& job, FrameLedger::Issued& issued) noexcept {
  const std::int64_t display_ns = slots_->slot().begin_ns + options_.pacing.display_delay_ns;
  // No overflow: host times stay within protocol::kMaxSimTimeNs, 1e18, and the instant between two
  // wall clocks that both count from 1970 stays below 8e18 until the year 2220.
  std::int64_t wanted_ns = input_.sim_time_ns + (display_ns - input_.received_ns);
  if (issued_any_) {
    // Jitter of the network must not turn into motion backwards.
    wanted_ns = std::max(wanted_ns, last_sim_time_ns_);
  }
  const PoseSample sample = seeker_.sample(wanted_ns, options_.pacing.horizon_ns);
  job.request.sim_time_ns = sample.shown_ns;
  job.request.sensor_pose = sample.pose;
  if (sample.extrapolated) {
    prediction_.predicted(sample.shown_ns, sample.pose);
  }
  issued.header.pose_sim_time_ns = sample.newest_ns;
  issued.header.flags |= (sample.extrapolated ? protocol::kFlagExtrapolated : 0U) |
                         (sample.stale ? protocol::kFlagStale : 0U);
  issued.entities_behind = !entities_.add_all_at(job, sample.shown_ns, options_.pacing.horizon_ns);
}

void Conductor::issue(RenderJob& job, FrameLedger::Issued& issued, bool is_step) noexcept {
  job.channels = due_channels(context_.channels, ledger_.next_number());
  job.request.thermal_time_ns = control_.thermal_time_ns(job.request.sim_time_ns, is_step);
  if (motion_) {
    const std::int64_t begin_ns =
        slots_ ? issued.header.slot_begin_ns : issued.header.host_received_ns;
    motion_->place(job, issued, begin_ns + options_.pacing.display_delay_ns);
  }
  look_ahead(job, issued);
  place_cameras(job, issued);
  // A frame before the first pose holds no later frame back.
  if (input_.came) {
    last_sim_time_ns_ = job.request.sim_time_ns;
    issued_any_ = true;
  }

  FrameHeader& header = issued.header;
  header.host_frame_number = input_.number;
  header.prediction_error_m = static_cast<float>(prediction_.latest().position_m);
  header.prediction_error_rad = static_cast<float>(prediction_.latest().attitude_rad);
  header.predictions = prediction_.measured();
  header.flags |= (control_.held() ? protocol::kFlagHold : 0U) |
                  (options_.canned ? protocol::kFlagCanned : 0U) |
                  (context_.clock.tai_offset_unset() ? protocol::kFlagTimeUnset : 0U);
  std::copy_n(weather_.begin(), weather_count_, job.weather.begin());
  job.weather_count = static_cast<std::uint32_t>(weather_count_);
  weather_count_ = 0;
  std::copy_n(parts_.begin(), part_count_, job.parts.begin());
  job.part_count = static_cast<std::uint32_t>(part_count_);
  part_count_ = 0;
  ledger_.issue(job, issued);
  context_.jobs.commit();
  context_.bells.render.ring();
}

void Conductor::begin_slot() noexcept {
  slot_policy_.begin(slots_->slot().number, control_.running() || control_.step_pending());
  if (slot_policy_.may_issue() && can_issue()) {
    issue_slot();
  }
}

int Conductor::take_images_and_slots(std::int64_t now_ns) noexcept {
  int work = 0;
  const bool slots_run = slots_ && !draining();
  // Images are taken in order of time: an image counts for the slot in which its pixels arrived.
  constexpr int kMaxPerTurn = 32;
  while (work < kMaxPerTurn) {
    const RenderDone* done = context_.done.front();
    const std::int64_t slot_end_ns = slots_run ? slots_->end_ns() : kNeverNs;
    if (now_ns >= slot_end_ns && (done == nullptr || done->readback_end_ns > slot_end_ns)) {
      if (!end_slot(now_ns)) {
        break;
      }
    } else if (done != nullptr) {
      if (!publish_image(*done, now_ns)) {
        break;
      }
      context_.done.pop();
    } else {
      break;
    }
    ++work;
  }
  return work;
}

bool Conductor::end_slot(std::int64_t now_ns) noexcept {
  if (room_to_publish() == nullptr) {
    return false;
  }
  switch (slot_policy_.end()) {
    case SlotPolicy::SlotEnd::nothing:
      break;
    case SlotPolicy::SlotEnd::no_image:
      context_.counters.add(Counter::slots_without_image);
      break;
    case SlotPolicy::SlotEnd::repeat:
      if (!publish_repeat(now_ns)) {
        return false;
      }
      break;
  }
  if (slots_->end(now_ns)) {
    begin_slot();
  }
  return true;
}

PublishFrame* Conductor::room_to_publish() noexcept {
  return context_.of_room.look([this] { return context_.published.claim(); });
}

bool Conductor::publish_image(const RenderDone& done, std::int64_t now_ns) noexcept {
  PublishFrame* frame = room_to_publish();
  if (frame == nullptr) {
    return false;
  }
  const bool late_for_slot = slots_ && slot_policy_.finished();
  const bool has_deadline = !slots_ || slots_->has_deadlines();
  FrameLedger::Issued& issued = ledger_.oldest();
  if (motion_) {
    motion_->finish(issued, done);
  }
  ledger_.fill_image(*frame, done, late_for_slot, has_deadline);
  hand_over(ledger_.shown());
  record_times(ledger_.shown());
  if (options_.gateway) {
    report({GatewayReport::Kind::published, ledger_.shown().host_frame_number});
  }
  journal_.frame(ledger_.shown(), ledger_.shown_for_journal(), true, issued.entity_span(),
                 issued.ahead.entity_span(), now_ns);
  ledger_.pop_oldest();
  return true;
}

bool Conductor::publish_repeat(std::int64_t now_ns) noexcept {
  PublishFrame* frame = room_to_publish();
  if (frame == nullptr) {
    return false;
  }
  ledger_.fill_repeat(*frame);
  const SlotSource::Slot& slot = slots_->slot();
  frame->header.deadline_ns = slot.deadline_ns;
  frame->header.slot_begin_ns = slot.begin_ns;
  frame->header.trigger_number = slot.trigger_number;
  if (motion_) {
    motion_->finish_repeat(frame->header, frame->image.ahead,
                           slot.begin_ns + options_.pacing.display_delay_ns);
  }
  const FrameHeader header = frame->header;  // the ring's element is the sender's after commit()
  hand_over(header);
  journal_.frame(header, ledger_.shown_for_journal(), false, {}, {}, now_ns);
  return true;
}

void Conductor::hand_over(const FrameHeader& header) noexcept {
  context_.published.commit();
  context_.frames_handed_over.fetch_add(1, std::memory_order_release);
  context_.bells.sender.ring();
  count_flags(header.flags);
}

void Conductor::count_flags(std::uint32_t flags) noexcept {
  context_.counters.add(Counter::frames_published);
  const auto count = [&](std::uint32_t flag, Counter id) {
    if ((flags & flag) != 0) {
      context_.counters.add(id);
    }
  };
  count(protocol::kFlagLate, Counter::frames_late);
  count(protocol::kFlagRepeated, Counter::frames_repeated);
  count(protocol::kFlagStale, Counter::frames_stale);
  count(protocol::kFlagExtrapolated, Counter::frames_extrapolated);
  count(protocol::kFlagMotionFault, Counter::frames_motion_fault);
}

void Conductor::record_times(const FrameHeader& header) noexcept {
  FrameTimes& times = context_.times;
  if (header.host_received_ns != 0) {
    times.wait.record(header.render_start_ns - header.host_received_ns);
    if (header.slot_begin_ns != 0) {
      times.sampling.record(header.slot_begin_ns - header.host_received_ns);
    }
  }
  times.render.record(header.render_end_ns - header.render_start_ns);
  times.readback.record(header.readback_end_ns - header.render_end_ns);
  times.frame.record(header.readback_end_ns - header.render_start_ns);
}

}  // namespace emit::server
