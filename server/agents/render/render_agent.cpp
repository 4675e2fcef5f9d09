// SPDX-License-Identifier: Apache-2.0
#include "agents/render/render_agent.hpp"

#include <algorithm>
#include <cstdlib>
#include <span>

namespace emit::server {

RenderAgent::~RenderAgent() = default;

bool RenderAgent::on_start() noexcept {
  auto source = factory_();
  if (!source) {
    info_ = tl::unexpected<physics::Error>(std::move(source.error()));
    return false;
  }
  source_ = std::move(*source);
  info_ = source_->info();
  return true;
}

void RenderAgent::on_stop() noexcept {
  while (count_ > 0) {
    for (const CameraImage& camera : in_flight_[first_].cameras) {
      if (!camera.shown) {
        continue;
      }
      if (!lost_) {  // a device that is gone might be waited for for ever
        static_cast<void>(source_->collect(camera.slot));
      }
      source_->release(camera.slot);
    }
    first_ = (first_ + 1) % kDepth;
    --count_;
  }
  source_.reset();
}

int RenderAgent::do_work(std::int64_t now_ns) noexcept {
  int work = 0;
  wake_at_ns_ = kNeverNs;
  if (lost_) {
    return 0;
  }
  take_feedback();
  if (finish_oldest()) {
    ++work;
  }
  if (take_job()) {
    ++work;
  }
  if (work == 0 && count_ > 0) {
    // The device does not ring; looking again after 50 us costs little beside a frame.
    wake_at_ns_ = now_ns + 50'000;
    if (context_.clock.monotonic_ns() - in_flight_[first_].begun_ns > kLongestFrameNs) {
      lose_device("a frame is not done within 60 s");
    }
  }
  return work;
}

bool RenderAgent::take_job() noexcept {
  RenderJob* job = context_.jobs.front();
  if (job == nullptr) {
    return false;
  }
  switch (job->kind) {
    case RenderJob::Kind::reset:
      source_->reset();
      weather_lost_ = false;
      dropped_poses_ = 0;
      heat_limits_.reset();
      coarse_told_.reset();
      break;
    case RenderJob::Kind::frame: {
      if (count_ == kDepth) {
        return false;
      }
      InFlight& next = in_flight_[(first_ + count_) % kDepth];
      if (!job_prepared_) {
        apply_weather(*job);
        apply_parts(*job);
        source_->apply_entities(job->request.sim_time_ns,
                                std::span(job->entities.data(), job->entity_count));
        next = {};
        next.begun_ns = context_.clock.monotonic_ns();
        // The job may have come after this turn began.
        next.render_start_ns = context_.clock.tai_ns();
        next.attitude = job->attitude;
        next.display_ns = job->display_ns;
        next.ahead_attitude = job->ahead.attitude;
        next.ahead_display_ns = job->ahead.display_ns;
        next.channels = job->channels;
        next.rendered_number = job->rendered_number;
        job_prepared_ = true;
      }
      if (!submit_shots(*job)) {
        // The agent that releases a slot rings the doorbell.
        if (!starved_) {
          context_.counters.add(Counter::no_free_slot);
          starved_ = true;
        }
        return false;
      }
      starved_ = false;
      job_prepared_ = false;
      ++count_;
      context_.counters.add(Counter::frames_submitted);
      break;
    }
  }
  context_.jobs.pop();
  return true;
}

bool RenderAgent::submit_shots(RenderJob& job) noexcept {
  InFlight& frame = in_flight_[(first_ + count_) % kDepth];
  const auto due = static_cast<std::size_t>(
      std::ranges::count_if(job.shots, [](const CameraShot& shot) { return shot.due; }));
  for (std::size_t i = 0; i < job.shots.size(); ++i) {
    const CameraShot& shot = job.shots[i];
    CameraImage& image = frame.cameras[i];
    if (!shot.due || image.shown) {
      continue;
    }
    renderer::FrameRequest request = job.request;
    request.frame_number += frame.shots;
    request.sensor_pose = shot.pose;
    request.fov_h_rad = shot.fov_h_rad;
    request.window_px = shot.window_px;
    if (shot.ahead) {
      source_->foresee_entities(job.ahead.sim_time_ns, job.ahead.entity_span());
      request.sim_time_ns = job.ahead.sim_time_ns;
    }
    // One quality level holds for all images of a frame, which share the time that is left.
    if (frame.shots == 0) {
      frame.quality_level = choose_quality_level(job, request, context_.clock.tai_ns(), due);
    }
    request.quality_level = frame.quality_level;
    const auto slot = context_.of_slots.look([&] { return submit(request, frame.warmed_up); });
    if (!slot) {
      return false;
    }
    if (job.deadline_ns != 0) {
      frame.expected_ms += source_->expected_levels(request)[frame.quality_level].frame_ms;
    }
    ++frame.shots;
    image.shown = true;
    image.slot = *slot;
    image.pose = shot.pose;
    image.fov_h_rad = shot.fov_h_rad;
  }
  return true;
}

std::optional<renderer::SlotIndex> RenderAgent::submit(const renderer::FrameRequest& request,
                                                       bool& warmed_up) noexcept {
  // The renderer does not report a warm-up inside submit(). It is recognised by its causes and its
  // effect: the thermal clock jumped further than a step of the surface, and submit() took long.
  const std::int64_t before_ns =
      last_thermal_ns_.value_or(info_->first_time_ns.value_or(request.thermal_time_ns));
  const std::int64_t moved_ns = request.thermal_time_ns - before_ns;
  const bool jumped = std::abs(moved_ns) > info_->surface_step_ns;
  const std::int64_t begun_ns = context_.clock.monotonic_ns();
  if (jumped) {
    context_.jump_since_ns.store(begun_ns, std::memory_order_relaxed);
  }
  const int slot = source_->submit(request);
  if (jumped) {
    context_.jump_since_ns.store(0, std::memory_order_relaxed);
  }
  if (slot < 0) {
    return std::nullopt;
  }
  last_thermal_ns_ = request.thermal_time_ns;
  const std::int64_t took_ns = context_.clock.monotonic_ns() - begun_ns;
  if (jumped && warms_up_again(took_ns)) {
    warmed_up = true;
    context_.counters.add(Counter::frames_warmed_up);
    context_.render_events.push(EventKind::warmed_up_again, static_cast<std::uint64_t>(took_ns),
                                static_cast<std::uint64_t>(moved_ns));
  }
  return static_cast<renderer::SlotIndex>(slot);
}

std::uint8_t RenderAgent::choose_quality_level(const RenderJob& job,
                                               const renderer::FrameRequest& first,
                                               std::int64_t now_ns, std::size_t shots) noexcept {
  if (job.deadline_ns == 0) {
    return 0;
  }
  const std::int64_t time_left_ns = (job.deadline_ns - now_ns) / static_cast<std::int64_t>(shots);
  return static_cast<std::uint8_t>(quality_.choose(source_->expected_levels(first), time_left_ns));
}

void RenderAgent::apply_weather(const RenderJob& job) noexcept {
  for (std::uint32_t i = 0; i < job.weather_count; ++i) {
    if (source_->apply_weather(job.weather[i])) {
      continue;
    }
    context_.counters.add(Counter::weather_lost);
    if (!weather_lost_) {
      // The warning is logged once per run: from here on its weather stands still.
      weather_lost_ = true;
      context_.render_events.push(EventKind::weather_lost,
                                  static_cast<std::uint64_t>(job.weather[i].sim_time_ns));
    }
  }
}

void RenderAgent::apply_parts(const RenderJob& job) noexcept {
  // The conductor has checked the parts. A command may still be older than the newest one of its
  // part, where a run goes on behind the scenario's.
  for (std::uint32_t i = 0; i < job.part_count; ++i) {
    static_cast<void>(source_->apply_part(job.parts[i].sim_time_ns, job.parts[i].update));
  }
}

void RenderAgent::note_dropped_poses(std::uint64_t in_run) noexcept {
  if (in_run <= dropped_poses_) {
    return;
  }
  context_.counters.add(Counter::poses_dropped, in_run - dropped_poses_);
  if (dropped_poses_ == 0) {
    context_.render_events.push(EventKind::poses_dropped, in_run);
  }
  dropped_poses_ = in_run;
}

void RenderAgent::note_heat_limits(const renderer::HeatLimits& limits) noexcept {
  // The counters are in the order of renderer::HeatLimit.
  static constexpr std::array<Counter, renderer::kHeatLimits> kCounters{
      Counter::frames_wet_unknown, Counter::frames_rain_shelter, Counter::frames_snowfall,
      Counter::frames_freezing,    Counter::frames_melting,      Counter::frames_humidity_unknown,
      Counter::frames_strong_wind, Counter::frames_longwave_low, Counter::frames_layers_invalid};
  if (limits.none()) return;
  for (std::size_t i = 0; i < renderer::kHeatLimits; ++i) {
    if (!limits[i]) continue;
    context_.counters.add(kCounters[i]);
    if (heat_limits_[i]) continue;
    heat_limits_[i] = true;
    context_.render_events.push(EventKind::heat_limit, i, 0,
                                renderer::text_of(static_cast<renderer::HeatLimit>(i)));
  }
}

void RenderAgent::note_coarse(const renderer::CoarseReasons& reasons) noexcept {
  // The counters are in the order of renderer::CoarseReason. A frame that warms up again is counted
  // and told where it does so.
  static constexpr std::array<Counter, renderer::kCoarseReasons - 1> kCounters{
      Counter::frames_coarse_camera,  Counter::frames_coarse_fov,   Counter::frames_coarse_samples,
      Counter::frames_coarse_meshes,  Counter::frames_coarse_shade, Counter::frames_coarse_shadows,
      Counter::frames_coarse_weather, Counter::frames_coarse_edges};
  static_assert(static_cast<std::size_t>(renderer::CoarseReason::warmed_up) == kCounters.size());
  if (reasons.none()) return;
  context_.counters.add(Counter::frames_coarse);
  for (std::size_t i = 0; i < kCounters.size(); ++i) {
    if (!reasons[i]) continue;
    context_.counters.add(kCounters[i]);
    if (coarse_told_[i]) continue;
    coarse_told_[i] = true;
    context_.render_events.push(EventKind::coarse, i, 0,
                                renderer::text_of(static_cast<renderer::CoarseReason>(i)));
  }
}

void RenderAgent::note_device(const renderer::FrameView& view) noexcept {
  if (!view.device_failed) {
    failures_ = 0;
    return;
  }
  context_.counters.add(Counter::device_failures);
  context_.render_events.push(EventKind::source_failed, 0, 0, "the device reported an error");
  if (view.device_lost) {
    lose_device("the driver reset the context");
  } else if (++failures_ >= kMaxFailures) {
    lose_device("the device reported errors for 30 frames in a row");
  }
}

void RenderAgent::lose_device(std::string_view why) noexcept {
  lost_ = true;
  context_.render_events.push(EventKind::device_lost, 0, 0, why);
  context_.device_lost.store(true, std::memory_order_release);
}

bool RenderAgent::finish_oldest() noexcept {
  if (count_ == 0) {
    return false;
  }
  InFlight& oldest = in_flight_[first_];
  // The device works on the images in the order of their submission.
  std::size_t camera = 0;
  for (std::size_t shots = 0; shots < oldest.collected || !oldest.cameras[camera].shown; ++camera) {
    shots += oldest.cameras[camera].shown ? 1U : 0U;
  }
  if (!source_->poll(oldest.cameras[camera].slot)) {
    return false;
  }
  RenderDone* done = context_.done.claim();
  if (done == nullptr) {
    return false;
  }
  if (oldest.collected == 0) {
    begin_done(oldest, oldest.cameras[camera].slot, *done);
  }
  finish_shot(oldest, camera, *done);
  if (++oldest.collected < oldest.shots) {
    return true;
  }
  done->image.cameras = oldest.cameras;
  done->image.camera_count = context_.cameras.size();
  done->warmed_up = oldest.warmed_up;
  // Neither a wall clock that is set nor a warm-up must be taken for a slow device.
  if (!oldest.warmed_up) {
    quality_.finished(context_.clock.monotonic_ns() - oldest.begun_ns, oldest.expected_ms);
  }
  context_.done.commit();
  context_.counters.add(Counter::frames_rendered);
  first_ = (first_ + 1) % kDepth;
  --count_;
  context_.bells.conductor.ring();
  return true;
}

void RenderAgent::begin_done(const InFlight& frame, renderer::SlotIndex slot,
                             RenderDone& done) noexcept {
  done.render_start_ns = frame.render_start_ns;
  done.nonfinite_px = done.clamped_px = 0;
  done.dropped_poses = 0;
  done.coarse = done.device_failed = false;
  done.quality_level = 0;
  done.estimated_error_k = 0.0F;
  done.image.source = source_.get();
  done.image.slot = slot;
  done.image.channels = frame.channels;
  done.image.pictures = {};
}

void RenderAgent::finish_shot(InFlight& frame, std::size_t camera, RenderDone& done) noexcept {
  CameraImage& image = frame.cameras[camera];
  done.render_end_ns = context_.clock.tai_ns();
  const renderer::FrameView& view = source_->collect(image.slot);
  done.readback_end_ns = context_.clock.tai_ns();
  image.readback_end_ns = done.readback_end_ns;
  image.nonfinite_px = view.stats.nonfinite_px;
  image.clamped_px = view.stats.clamped_px;
  image.coarse =
      view.stats.coarse.any() || view.stats.plain_targets > 0 || view.stats.heat_limits.any();
  done.nonfinite_px += view.stats.nonfinite_px;
  done.clamped_px += view.stats.clamped_px;
  done.dropped_poses = view.stats.dropped_poses;
  note_dropped_poses(view.stats.dropped_poses);
  done.coarse = done.coarse || image.coarse;
  note_coarse(view.stats.coarse);
  note_heat_limits(view.stats.heat_limits);
  context_.counters.add(Counter::targets_plain, view.stats.plain_targets);
  // The level of the image that lost most stands for the frame.
  if (view.quality_level >= done.quality_level) {
    done.quality_level = view.quality_level;
    done.estimated_error_k = view.estimated_error_k;
  }
  image.quality_level = view.quality_level;
  image.estimated_error_k = view.estimated_error_k;
  done.device_failed = done.device_failed || view.device_failed;
  note_device(view);
  if (frame.collected == 0) {
    find_shifts(frame, done);
  }
  take_pictures(frame, camera, view, image.slot, done.image);
}

void RenderAgent::take_feedback() noexcept {
  while (const AxisFeedback* feedback = context_.shift_feedback.front()) {
    if (shifts_) shifts_->add(*feedback);
    context_.shift_feedback.pop();
  }
}

void RenderAgent::find_shifts(const InFlight& frame, RenderDone& done) noexcept {
  done.shift_known = done.ahead_shift_known = true;
  done.image.shift_px = glm::vec2(0.0F);
  done.image.ahead = {};
  if (!shifts_) return;
  take_feedback();
  done.shift_known = find_shift(frame.attitude, frame.display_ns, done.image.shift_px);
  const bool ahead = std::ranges::any_of(context_.cameras,
                                         [](const Camera& camera) { return camera.looks_ahead(); });
  if (!ahead) return;
  done.ahead_shift_known =
      find_shift(frame.ahead_attitude, frame.ahead_display_ns, done.image.ahead.shift_px);
}

bool RenderAgent::find_shift(const ShownAttitude& attitude, std::int64_t display_ns,
                             glm::vec2& shift_px) noexcept {
  if (const auto found_px = shifts_->shift_px(attitude, display_ns)) {
    shift_px = *found_px;
    return true;
  }
  context_.counters.add(Counter::output_shifts_unknown);
  return false;
}

void RenderAgent::take_pictures(const InFlight& frame, std::size_t camera,
                                const renderer::FrameView& view, renderer::SlotIndex slot,
                                Image& image) noexcept {
  const std::span<Picture> pictures(context_.pictures);
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (pictures[i].camera != camera || (pictures[i].channels & image.channels) == 0) {
      continue;
    }
    const glm::vec2& shift_px =
        context_.cameras[camera].looks_ahead() ? image.ahead.shift_px : image.shift_px;
    const TakenPicture taken =
        take_picture(pictures[i], view, slot, {shift_px, frame.rendered_number});
    image.pictures[i] = taken.pixels;
    image.clamped_px[i] = taken.clamped_px;
    context_.counters.add(Counter::output_px_clamped, taken.clamped_px);
    image.cut[i] = taken.cut;
    if (taken.cut) context_.counters.add(Counter::output_shifts_cut);
    // Planes that share memory (canned frames) are summed once.
    const bool same = i > 0 && image.pictures[i].data() == image.pictures[i - 1].data() &&
                      image.pictures[i].size() == image.pictures[i - 1].size();
    image.crc32c[i] =
        same ? image.crc32c[i - 1] : protocol::crc32c(std::as_bytes(image.pictures[i]));
  }
}

}  // namespace emit::server
