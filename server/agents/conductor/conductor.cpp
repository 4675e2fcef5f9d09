// SPDX-License-Identifier: Apache-2.0
#include "agents/conductor/conductor.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace emit::server {

using protocol::FrameHeader;

namespace {

/// An entity that stands is told again so often that its pose history sees it at rest.
constexpr std::int64_t kStandsForNs = 250'000'000;

/// Ends of one interpolation differ by rounding though the body stands.
bool same_place(const physics::Pose& a, const physics::Pose& b) noexcept {
  constexpr double kSameM = 1e-6;
  constexpr double kSameRad = 1e-9;
  const glm::dvec3 moved_m = glm::abs(a.position_world_m - b.position_world_m);
  const glm::dquat turned = a.world_from_body - b.world_from_body;
  return std::max({moved_m.x, moved_m.y, moved_m.z}) <= kSameM &&
         std::max({std::abs(turned.w), std::abs(turned.x), std::abs(turned.y),
                   std::abs(turned.z)}) <= kSameRad;
}

}  // namespace

Conductor::Conductor(Context& context, const ScenarioTracks& scenario, const Options& options,
                     TriggerInput* triggers)
    : Agent(context.bells.conductor),
      context_(context),
      scenario_(scenario),
      options_(options),
      journal_(context.journal, context.journal_handed_over),
      clock_(options.pacing.rate_hz),
      triggers_(triggers),
      trigger_(options.pacing.rate_hz, options.pacing.budget_ns),
      issued_(kMaxIssued) {
  entities_.reserve(kMaxTracked);
  touched_.reserve(kMaxTracked);
}

bool Conductor::on_start() noexcept {
  start_run(context_.clock.tai_ns());
  return true;
}

std::int64_t Conductor::wake_at_ns() const noexcept {
  if (triggered()) {
    return trigger_wake_at_ns();
  }
  return ig_clock() && clock_started_ && !draining_.load(std::memory_order_relaxed)
             ? clock_.end_ns()
             : kNeverNs;
}

std::int64_t Conductor::slot_end_ns() const noexcept {
  if (ig_clock()) {
    return clock_started_ ? clock_.end_ns() : kNeverNs;
  }
  if (!trigger_.is_open()) {
    return kNeverNs;
  }
  return pending_trigger_ ? std::min(trigger_.end_ns(), pending_trigger_->received_ns)
                          : trigger_.end_ns();
}

int Conductor::do_work(std::int64_t now_ns) noexcept {
  if (triggered() && !draining_.load(std::memory_order_acquire)) {
    poll_triggers(now_ns);
  }
  int work = take_images_and_slots(now_ns);
  if (draining_.load(std::memory_order_acquire)) {
    if (issued_count_ == 0) {
      drained_.store(true, std::memory_order_release);
    }
    return work;
  }
  work += take_inputs(now_ns);
  if (ig_clock() && !clock_started_) {
    clock_.start(now_ns);
    clock_started_ = true;
    begin_slot();
    ++work;
  }
  // Behind the inputs: the frame shows the newest pose that is there.
  if (triggered() && begin_triggered_slot()) {
    ++work;
  }
  return work;
}

void Conductor::start_run(std::int64_t now_ns) noexcept {
  run_id_ = std::max(run_id_ + 1, static_cast<std::uint64_t>(std::max<std::int64_t>(now_ns, 0)));
  frame_number_ = 0;
  render_number_ = 0;
  control_.new_run();
  weather_count_ = 0;
  seeker_.clear();
  prediction_.clear();
  entities_.clear();
  touched_.clear();
  next_entity_ = 0;
  next_standing_ = 0;
  have_host_frame_ = false;
  host_frame_number_ = 0;
  host_sim_time_ns_ = 0;
  host_received_ns_ = 0;
  last_sim_time_ns_ = 0;
  issued_any_ = false;
  shown_ = {};
  slots_.reset();
  context_.run_id.store(run_id_, std::memory_order_relaxed);

  JournalRunStart line;
  line.head = {0, now_ns, JournalKind::run_start};
  line.run_id = run_id_;
  if (!journal_.write(line)) {
    count_lost_line();
  }
  context_.bells.recorder.ring();
  context_.conductor_events.push(EventKind::run_started, run_id_);
}

bool Conductor::reset_run(std::int64_t now_ns) noexcept {
  reset_pending_ = true;
  RenderJob* job = context_.jobs.claim();
  if (issued_count_ > 0 || job == nullptr) {
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
  return issued_count_ < kMaxIssued && context_.jobs.claim() != nullptr && !reset_pending_;
}

Conductor::Issued& Conductor::next_issued() noexcept {
  Issued& issued = issued_[(issued_first_ + issued_count_) % kMaxIssued];
  issued.header = {};
  issued.entities_behind = false;
  issued.entity_count = 0;
  return issued;
}

void Conductor::add_update(RenderJob& job, Entity& entity, const physics::Pose& pose,
                           std::int64_t base_ns) noexcept {
  renderer::EntityUpdate& update = job.entities[job.entity_count++];
  update.entity_id = entity.id;
  update.pose = pose;
  update.on = entity.on;
  // While the instant shown is still before the jump, so is the pose.
  update.teleport = entity.teleport_pending && base_ns >= entity.first_teleport_ns;
  if (update.teleport) {
    entity.teleport_pending = base_ns < entity.last_teleport_ns;
    entity.first_teleport_ns = entity.last_teleport_ns;
  }
}

bool Conductor::add_updates(RenderJob& job, std::int64_t shown_ns) noexcept {
  for (Entity& body : entities_) {
    body.placed = body.track.sample(shown_ns, options_.pacing.horizon_ns);
    body.moved = !body.shown || body.teleport_pending || body.shown->on != body.on ||
                 !same_place(body.shown->pose, body.placed.pose);
    body.told = false;
  }
  // From `next` on, at most so many; false and the next one in `next` where that left one out.
  const auto tell = [&](std::size_t& next, std::size_t most, const auto& wanted) {
    for (std::size_t i = 0, first = next; i < entities_.size(); ++i) {
      const std::size_t at = (first + i) % entities_.size();
      Entity& body = entities_[at];
      if (body.told || !wanted(body)) {
        continue;
      }
      if (most == 0 || job.entity_count == job.entities.size()) {
        next = at;
        return false;
      }
      --most;
      body.told = true;
      body.shown = {body.placed.pose, shown_ns, body.on};
      add_update(job, body, body.placed.pose, body.placed.base_ns);
    }
    return true;
  };
  const auto moved = [](const Entity& body) { return body.moved; };
  const auto overdue = [&](const Entity& body) {
    return !body.moved && shown_ns - body.shown->sim_time_ns >= kStandsForNs;
  };
  constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
  // Of more than a frame takes, those that stand where they were can wait, but not for ever.
  constexpr std::size_t kMostOverdue = 8;
  static_cast<void>(tell(next_standing_, kMostOverdue, overdue));
  const bool up_to_date = tell(next_entity_, kAll, moved);
  static_cast<void>(tell(next_standing_, kAll, overdue) &&
                    tell(next_standing_, kAll, [](const Entity&) { return true; }));
  return up_to_date;
}

void Conductor::issue_host_step(bool is_step, std::int64_t received_ns) noexcept {
  RenderJob& job = context_.jobs.claim_reserved();
  Issued& issued = next_issued();
  job.kind = RenderJob::Kind::frame;
  job.entity_count = 0;
  job.request.sim_time_ns = host_sim_time_ns_;
  job.request.sensor_pose = seeker_.newest().pose;
  std::size_t applied = 0;
  for (; applied < touched_.size() && job.entity_count < job.entities.size(); ++applied) {
    Entity* found = entity(touched_[applied]);
    if (found == nullptr) {
      continue;  // entities leave only with the whole list, in start_run()
    }
    found->touched = false;
    const TimedPose& newest = found->track.newest();
    add_update(job, *found, newest.pose, newest.sim_time_ns);
  }
  touched_.erase(touched_.begin(), touched_.begin() + static_cast<std::ptrdiff_t>(applied));
  issued.entities_behind = !touched_.empty();
  issued.header.pose_sim_time_ns = host_sim_time_ns_;
  issued.header.host_received_ns = received_ns;
  if (options_.pacing.budget_ns > 0) {
    issued.header.deadline_ns = received_ns + options_.pacing.budget_ns;
  }
  issue(job, issued, is_step);
}

void Conductor::issue_slotted() noexcept {
  RenderJob& job = context_.jobs.claim_reserved();
  Issued& issued = next_issued();
  job.kind = RenderJob::Kind::frame;
  job.entity_count = 0;
  issued.header.deadline_ns = slot_deadline_ns();
  issued.header.slot_begin_ns = slot_begin_ns();
  if (triggered()) {
    issued.header.trigger_number = trigger_.slot_number();
    issued.header.flags |= trigger_fault_ ? protocol::kFlagTriggerFault : 0U;
    trigger_fault_ = false;
  }
  issued.header.host_received_ns = host_received_ns_;
  if (!have_host_frame_) {
    // Show the scenario's own start until the host speaks. The frame says that nobody steers it,
    // unless it is a canned one, which no pose would change.
    job.request.sim_time_ns = 0;
    job.request.sensor_pose = scenario_.sensor_at(0);
    issued.header.flags |= options_.canned ? 0U : protocol::kFlagStale;
  } else {
    const std::int64_t display_ns = slot_begin_ns() + options_.pacing.display_delay_ns;
    // No overflow: host times stay within protocol::kMaxSimTimeNs, 1e18, and the instant between
    // two wall clocks that both count from 1970 below 8e18 until the year 2220.
    std::int64_t wanted_ns = host_sim_time_ns_ + (display_ns - host_received_ns_);
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
    issued.entities_behind = !add_updates(job, sample.shown_ns);
  }
  slots_.issued();
  issue(job, issued, control_.step_pending());
}

void Conductor::issue(RenderJob& job, Issued& issued, bool is_step) noexcept {
  job.request.frame_number = ++render_number_;
  // Under what number it will go out, if it is in time.
  job.channels = due_channels(context_.channels, frame_number_ + issued_count_ + 1);
  job.request.window_px = window_around(context_.channels, job.channels);
  job.request.thermal_time_ns = control_.thermal_time_ns(job.request.sim_time_ns, is_step);
  last_sim_time_ns_ = job.request.sim_time_ns;
  issued_any_ = true;

  FrameHeader& header = issued.header;
  header.run_id = run_id_;
  header.host_frame_number = host_frame_number_;
  header.sim_time_ns = job.request.sim_time_ns;
  header.pose = job.request.sensor_pose;
  header.prediction_error_m = static_cast<float>(prediction_.latest().position_m);
  header.prediction_error_rad = static_cast<float>(prediction_.latest().attitude_rad);
  header.predictions = prediction_.measured();
  header.flags |= (control_.held() ? protocol::kFlagHold : 0U) |
                  (options_.canned ? protocol::kFlagCanned : 0U) |
                  (context_.clock.tai_offset_unset() ? protocol::kFlagTimeUnset : 0U);
  job.deadline_ns = header.deadline_ns;
  issued.thermal_time_ns = job.request.thermal_time_ns;
  issued.entity_count = job.entity_count;
  std::copy_n(job.entities.begin(), job.entity_count, issued.entities.begin());
  std::copy_n(weather_.begin(), weather_count_, job.weather.begin());
  job.weather_count = static_cast<std::uint32_t>(weather_count_);
  weather_count_ = 0;
  ++issued_count_;
  context_.jobs.commit();
  context_.bells.render.ring();
}

void Conductor::begin_slot() noexcept {
  slots_.begin(triggered() ? trigger_.slot() : clock_.slot(),
               control_.running() || control_.step_pending());
  if (slots_.may_issue() && can_issue()) {
    issue_slotted();
  }
}

int Conductor::take_images_and_slots(std::int64_t now_ns) noexcept {
  int work = 0;
  const bool slots_run =
      slotted() && (triggered() || clock_started_) && !draining_.load(std::memory_order_acquire);
  if (slots_run && ig_clock() && clock_.must_restart(now_ns)) {
    clock_.start(now_ns);
    context_.conductor_events.push(EventKind::slots_missed, 0);
  }
  // In order of time: an image counts for the slot in which its pixels arrived.
  constexpr int kMaxPerTurn = 32;
  while (work < kMaxPerTurn) {
    const RenderDone* done = context_.done.front();
    const bool slot_ended = slots_run && now_ns >= slot_end_ns();
    if (slot_ended && (done == nullptr || done->readback_end_ns > slot_end_ns())) {
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
  switch (slots_.end()) {
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
  if (triggered()) {
    trigger_.close();
    return true;  // the next slot begins with its trigger
  }
  const std::uint64_t missed = clock_.advance(now_ns);
  if (missed > 0) {
    context_.counters.add(Counter::slots_missed, missed);
    context_.conductor_events.push(EventKind::slots_missed, missed);
  }
  begin_slot();
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
  const Issued& issued = issued_[issued_first_];
  frame->repeat = false;
  frame->image = done.image;
  FrameHeader& header = frame->header;
  header = issued.header;
  header.frame_number = ++frame_number_;
  header.render_start_ns = done.render_start_ns;
  header.render_end_ns = done.render_end_ns;
  header.readback_end_ns = done.readback_end_ns;
  header.nonfinite_px = done.nonfinite_px;
  header.clamped_px = done.clamped_px;
  header.flags |= (done.nonfinite_px > 0 ? protocol::kFlagNonFinite : 0U) |
                  (done.clamped_px > 0 ? protocol::kFlagClamped : 0U);
  if (done.rung > 0) {
    header.flags |= protocol::kFlagDegraded;
    header.quality_rung = done.rung;
    header.estimated_error_k = done.estimated_error_k;
    context_.counters.add(Counter::frames_shed);
  }
  if (issued.entities_behind) {
    context_.counters.add(Counter::frames_entities_behind);
  }
  if (done.dropped_poses > 0 || done.coarse || issued.entities_behind) {
    // How much the coarser past or surface, or an entity that stands where it was a frame ago,
    // matters depends on what it shaded: nobody knows.
    header.flags |= protocol::kFlagDegraded;
    header.estimated_error_k = std::numeric_limits<float>::quiet_NaN();
  }
  if (done.device_failed) {
    header.flags |= protocol::kFlagDegraded;
    header.estimated_error_k = std::numeric_limits<float>::infinity();
  }
  bool late = slotted() && slots_.finished();
  if (!ig_clock()) {
    late = late || is_past_deadline(header.deadline_ns, done.readback_end_ns);
  }
  if (late) {
    header.flags |= protocol::kFlagLate;
  }
  shown_ = header;
  shown_thermal_ns_ = issued.thermal_time_ns;
  for (const Channel& channel : context_.channels) {
    if ((done.image.channels >> channel.index & 1U) != 0) {
      shown_channel_ = channel.index;
      shown_crc_ = done.image.crc32c[channel.picture];
      break;
    }
  }
  context_.published.commit();
  context_.frames_handed_over.fetch_add(1, std::memory_order_release);
  context_.bells.sender.ring();
  count_flags(shown_.flags);
  record_times(shown_);
  journal_frame(shown_, &issued, now_ns);
  issued_first_ = (issued_first_ + 1) % kMaxIssued;
  --issued_count_;
  return true;
}

bool Conductor::publish_repeat(std::int64_t now_ns) noexcept {
  PublishFrame* frame = room_to_publish();
  if (frame == nullptr) {
    return false;
  }
  frame->repeat = true;
  frame->image = {};
  frame->image.channels = due_channels(context_.channels, frame_number_ + 1);
  frame->header = shown_;
  frame->header.frame_number = ++frame_number_;
  frame->header.deadline_ns = slot_deadline_ns();
  frame->header.slot_begin_ns = slot_begin_ns();
  frame->header.trigger_number = triggered() ? trigger_.slot_number() : 0;
  frame->header.flags =
      (shown_.flags & ~std::uint32_t{protocol::kFlagLate}) | protocol::kFlagRepeated;
  const FrameHeader header = frame->header;
  context_.published.commit();
  context_.frames_handed_over.fetch_add(1, std::memory_order_release);
  context_.bells.sender.ring();
  count_flags(header.flags);
  journal_frame(header, nullptr, now_ns);
  return true;
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

void Conductor::journal_frame(const FrameHeader& header, const Issued* issued,
                              std::int64_t now_ns) noexcept {
  JournalFrame line;
  line.head = {0, now_ns, JournalKind::frame};
  line.frame_number = header.frame_number;
  line.host_frame_number = header.host_frame_number;
  line.sim_time_ns = header.sim_time_ns;
  line.pose_sim_time_ns = header.pose_sim_time_ns;
  line.thermal_time_ns = shown_thermal_ns_;
  line.sensor_pose = header.pose;
  line.flags = header.flags;
  line.quality_rung = header.quality_rung;
  line.radiance_crc32c = shown_crc_;
  line.radiance_channel = shown_channel_;
  line.rendered = issued != nullptr;
  line.trigger_number = header.trigger_number;
  line.slot_begin_ns = header.slot_begin_ns;
  line.entity_count = issued != nullptr ? issued->entity_count : 0;
  const std::span<const renderer::EntityUpdate> entities =
      issued != nullptr
          ? std::span<const renderer::EntityUpdate>(issued->entities.data(), issued->entity_count)
          : std::span<const renderer::EntityUpdate>();
  if (!journal_.write(line, entities)) {
    count_lost_line();
  }
  context_.bells.recorder.ring();
}

void Conductor::count_lost_line() noexcept {
  context_.counters.add(Counter::journal_dropped);
  if (!journal_lossy_) {
    // Once: from here on this run's journal cannot be replayed.
    journal_lossy_ = true;
    context_.conductor_events.push(EventKind::journal_overrun, journal_.sequence());
  }
}

}  // namespace emit::server
