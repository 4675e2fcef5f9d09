// SPDX-License-Identifier: Apache-2.0
#include "agents/conductor/frame_ledger.hpp"

#include <algorithm>
#include <limits>

#include "emit/physics/check.hpp"

namespace emit::server {

using protocol::FrameHeader;

std::uint64_t FrameLedger::begin_run(std::int64_t now_ns) noexcept {
  run_id_ = std::max(run_id_ + 1, static_cast<std::uint64_t>(std::max<std::int64_t>(now_ns, 0)));
  frame_number_ = 0;
  render_number_ = 0;
  shown_ = {};
  return run_id_;
}

FrameLedger::Issued& FrameLedger::next() noexcept {
  EMIT_DCHECK(!full());
  Issued& issued = issued_[(first_ + in_work_) % kMaxInWork];
  issued.header = {};
  issued.entities_behind = false;
  issued.entity_count = 0;
  return issued;
}

void FrameLedger::issue(RenderJob& job, Issued& issued) noexcept {
  EMIT_DCHECK(!full());
  job.request.frame_number = ++render_number_;
  job.deadline_ns = issued.header.deadline_ns;
  issued.header.run_id = run_id_;
  issued.header.sim_time_ns = job.request.sim_time_ns;
  issued.header.pose = job.request.sensor_pose;
  issued.thermal_time_ns = job.request.thermal_time_ns;
  issued.entity_count = job.entity_count;
  std::copy_n(job.entities.begin(), job.entity_count, issued.entities.begin());
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

void FrameLedger::fill_image(PublishFrame& out, const RenderDone& done, bool late) noexcept {
  const Issued& issued = oldest();
  out.repeat = false;
  out.image = done.image;
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
                  (late ? protocol::kFlagLate : 0U);
  note_quality(header, issued, done);
  shown_ = header;
  shown_for_journal_.thermal_time_ns = issued.thermal_time_ns;
  shown_for_journal_.shift_px = done.image.shift_px;
  for (const Channel& channel : context_.channels) {
    if ((done.image.channels >> channel.index & 1U) != 0) {
      shown_for_journal_.channel = channel.index;
      shown_for_journal_.crc32c = done.image.crc32c[channel.picture];
      break;
    }
  }
}

void FrameLedger::note_quality(FrameHeader& header, const Issued& issued,
                               const RenderDone& done) noexcept {
  if (done.quality_level > 0) {
    header.flags |= protocol::kFlagDegraded;
    header.quality_rung = done.quality_level;
    header.estimated_error_k = done.estimated_error_k;
    context_.counters.add(Counter::frames_shed);
  }
  if (issued.entities_behind) {
    context_.counters.add(Counter::frames_entities_behind);
  }
  if (done.dropped_poses > 0 || done.coarse || done.warmed_up || issued.entities_behind) {
    // The error is unknown when the past or the surface is coarser, or when an entity stands where
    // it was a frame ago: it depends on the places that the entity shaded.
    header.flags |= protocol::kFlagDegraded;
    header.estimated_error_k = std::numeric_limits<float>::quiet_NaN();
  }
  if (done.device_failed) {
    header.flags |= protocol::kFlagDegraded;
    header.estimated_error_k = std::numeric_limits<float>::infinity();
  }
}

void FrameLedger::fill_repeat(PublishFrame& out) noexcept {
  out.repeat = true;
  out.image = {};
  out.image.channels = due_channels(context_.channels, frame_number_ + 1);
  out.header = shown_;
  out.header.frame_number = ++frame_number_;
  out.header.flags = (shown_.flags & ~std::uint32_t{protocol::kFlagLate}) | protocol::kFlagRepeated;
}

}  // namespace emit::server
