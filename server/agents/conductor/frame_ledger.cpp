// SPDX-License-Identifier: Apache-2.0
#include "agents/conductor/frame_ledger.hpp"

#include <algorithm>
#include <limits>

#include "emit/physics/check.hpp"
#include "pacing/deadline_policy.hpp"

namespace emit::server {

using protocol::FrameHeader;

std::uint64_t FrameLedger::begin_run(std::int64_t now_ns) noexcept {
  run_id_ = std::max(run_id_ + 1, static_cast<std::uint64_t>(std::max<std::int64_t>(now_ns, 0)));
  frame_number_ = 0;
  render_number_ = 0;
  rendered_number_ = 0;
  shown_ = {};
  return run_id_;
}

FrameLedger::Issued& FrameLedger::next() noexcept {
  EMIT_DCHECK(!full());
  Issued& issued = issued_[(first_ + in_work_) % kMaxInWork];
  issued.header = {};
  issued.entities_behind = false;
  issued.ahead.image = {};
  issued.ahead.entity_count = 0;
  issued.entity_count = 0;
  return issued;
}

void FrameLedger::issue(RenderJob& job, Issued& issued) noexcept {
  EMIT_DCHECK(!full());
  job.request.frame_number = render_number_ + 1;
  job.rendered_number = ++rendered_number_;
  render_number_ += static_cast<std::uint64_t>(
      std::ranges::count_if(job.shots, [](const CameraShot& shot) { return shot.due; }));
  job.deadline_ns = issued.header.deadline_ns;
  issued.header.run_id = run_id_;
  issued.header.sim_time_ns = job.request.sim_time_ns;
  issued.header.pose = job.request.sensor_pose;
  issued.header.fov_h_rad = static_cast<float>(job.request.fov_h_rad);
  issued.fov_h_rad = job.request.fov_h_rad;
  issued.thermal_time_ns = job.request.thermal_time_ns;
  issued.entity_count = job.entity_count;
  std::copy_n(job.entities.begin(), job.entity_count, issued.entities.begin());
  issued.ahead.entity_count = job.ahead.entity_count;
  std::copy_n(job.ahead.entities.begin(), job.ahead.entity_count, issued.ahead.entities.begin());
  ++in_work_;
}

FrameLedger::Issued& FrameLedger::oldest() noexcept {
  EMIT_DCHECK(!idle());
  return issued_[first_];
}

void FrameLedger::pop_oldest() noexcept {
  EMIT_DCHECK(!idle());
  first_ = (first_ + 1) % kMaxInWork;
  --in_work_;
}

void FrameLedger::fill_image(PublishFrame& out, const RenderDone& done, bool late_for_slot,
                             bool has_deadline) noexcept {
  const Issued& issued = oldest();
  const auto late_flag = [&](std::int64_t ready_ns) {
    const bool late =
        late_for_slot || (has_deadline && is_past_deadline(issued.header.deadline_ns, ready_ns));
    return late ? std::uint32_t{protocol::kFlagLate} : 0U;
  };
  out.repeat = false;
  out.image = done.image;
  out.image.ahead = issued.ahead.image;
  shown_ahead_ = issued.ahead.image;
  FrameHeader& header = out.header;
  header = issued.header;
  header.frame_number = ++frame_number_;
  header.render_start_ns = done.render_start_ns;
  header.render_end_ns = done.render_end_ns;
  header.readback_end_ns = done.readback_end_ns;
  header.nonfinite_px = done.nonfinite_px;
  header.clamped_px = done.clamped_px;
  header.flags |= (done.nonfinite_px > 0 ? protocol::kFlagNonFinite : 0U) |
                  (done.clamped_px > 0 ? protocol::kFlagClamped : 0U) |
                  late_flag(done.readback_end_ns);
  const bool unknown_error = done.dropped_poses > 0 || done.warmed_up || issued.entities_behind;
  note_quality(header, {done.quality_level, done.estimated_error_k, unknown_error || done.coarse,
                        done.device_failed});
  if (header.quality_rung > 0) context_.counters.add(Counter::frames_shed);
  if (issued.entities_behind) context_.counters.add(Counter::frames_entities_behind);
  for (CameraImage& camera : out.image.cameras) {
    if (!camera.shown || done.image.camera_count == 1) continue;
    FrameHeader own;
    own.flags = (camera.nonfinite_px > 0 ? protocol::kFlagNonFinite : 0U) |
                (camera.clamped_px > 0 ? protocol::kFlagClamped : 0U) |
                late_flag(camera.readback_end_ns);
    note_quality(own, {camera.quality_level, camera.estimated_error_k,
                       unknown_error || camera.coarse, done.device_failed});
    camera.flags = own.flags & kCameraFlags;
    camera.estimated_error_k = own.estimated_error_k;
  }
  shown_ = header;
  shown_for_journal_.thermal_time_ns = issued.thermal_time_ns;
  shown_for_journal_.fov_h_rad = issued.fov_h_rad;
  shown_for_journal_.shift_px = done.image.shift_px;
  shown_for_journal_.ahead_shift_px = done.image.ahead.shift_px;
  shown_for_journal_.ahead_time_ns = issued.ahead.image.sim_time_ns;
  note_shots(done.image);
}

void FrameLedger::note_shots(const Image& image) noexcept {
  shown_for_journal_.more_shot_count = 0;
  bool first = true;
  for (std::size_t i = 0; i < image.camera_count; ++i) {
    const CameraImage& camera = image.cameras[i];
    const auto channel = std::ranges::find_if(context_.channels, [&](const Channel& one) {
      return one.camera == i && (image.channels >> one.index & 1U) != 0;
    });
    if (!camera.shown || channel == context_.channels.end()) continue;
    const JournalShot shot{camera.pose, camera.fov_h_rad, channel->index,
                           image.crc32c[channel->picture], channel->look_ahead_frames > 0};
    if (first) {
      shown_for_journal_.channel = shot.channel;
      shown_for_journal_.crc32c = shot.crc32c;
      first = false;
    } else {
      shown_for_journal_.more_shots[shown_for_journal_.more_shot_count++] = shot;
    }
  }
}

void FrameLedger::note_quality(FrameHeader& header, const Quality& quality) noexcept {
  if (quality.level > 0) {
    header.flags |= protocol::kFlagDegraded;
    header.quality_rung = quality.level;
    header.estimated_error_k = quality.estimated_error_k;
  }
  if (quality.unknown_error) {
    // The error is unknown when the past or the surface is coarser, or when an entity stands where
    // it was a frame ago: it depends on the places that the entity shaded.
    header.flags |= protocol::kFlagDegraded;
    header.estimated_error_k = std::numeric_limits<float>::quiet_NaN();
  }
  if (quality.device_failed) {
    header.flags |= protocol::kFlagDegraded;
    header.estimated_error_k = std::numeric_limits<float>::infinity();
  }
}

void FrameLedger::fill_repeat(PublishFrame& out) noexcept {
  out.repeat = true;
  out.image = {};
  out.image.ahead = shown_ahead_;
  out.image.channels = due_channels(context_.channels, frame_number_ + 1);
  out.header = shown_;
  out.header.frame_number = ++frame_number_;
  out.header.flags = (shown_.flags & ~std::uint32_t{protocol::kFlagLate}) | protocol::kFlagRepeated;
}

}  // namespace emit::server
