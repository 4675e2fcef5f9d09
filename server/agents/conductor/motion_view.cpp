// SPDX-License-Identifier: Apache-2.0
#include "agents/conductor/motion_view.hpp"

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>

namespace emit::server {

using protocol::FrameHeader;
using protocol::MotionState;

namespace {

bool follows(const FrameHeader& header) noexcept {
  return header.motion_state == MotionState::following && header.motion_faults == 0;
}

}  // namespace

void MotionView::start_run() noexcept {
  target_moved_ = false;
  shown_count_ = 0;
  pointing_error_px_.reset();
  MotionInput input;
  input.kind = MotionInput::Kind::reset;
  push(input);
}

void MotionView::push(const MotionInput& input) noexcept {
  if (!context_.motion_inputs.push(input)) {
    context_.counters.add(Counter::axes_inputs_dropped);
  }
  context_.bells.motion.ring();
}

void MotionView::take_pose(const protocol::HostFrameData& frame) noexcept {
  MotionInput input;
  input.received_ns = frame.received_ns;
  input.pose.sim_time_ns = frame.sim_time_ns;
  input.pose.seeker = frame.seeker;
  input.pose.seeker_rates = frame.seeker_rates;
  if (plan_.target_entity) {
    for (const protocol::EntityStateData& entity : frame.entity_span()) {
      if (entity.entity_id != *plan_.target_entity || !entity.has_pose) continue;
      target_m_ = entity.pose.position_world_m;
      target_moved_ = true;
      if (entity.rates) input.pose.target_velocity_m_s = entity.rates->velocity_world_m_s;
    }
    input.pose.target_m =
        target_moved_
            ? target_m_
            : scenario_.entity_at(*plan_.target_entity, frame.sim_time_ns).pose.position_world_m;
  }
  push(input);
}

int MotionView::take_reports() noexcept {
  int taken = 0;
  constexpr int kMost = 1024;
  for (; taken < kMost; ++taken) {
    const MotionReport* report = context_.motion_reports.front();
    if (report == nullptr) break;
    if (report->has_feedback && !track_.add(report->feedback)) {
      // The controller was started anew, or its clock was set.
      track_.clear();
      static_cast<void>(track_.add(report->feedback));
    }
    state_ = report->state;
    faults_ = report->faults;
    context_.motion_reports.pop();
  }
  if (taken > 0) judge_shown();
  return taken;
}

TableAngles MotionView::angles_at(std::int64_t time_ns, bool& known) const noexcept {
  const auto state = track_.at(time_ns, plan_.horizon_ns);
  known = state.has_value();
  if (state) return state->angles;
  const AxisFeedback* latest = track_.latest();
  return latest != nullptr ? latest->angles : TableAngles{};
}

glm::dvec2 MotionView::shift_px(const FrameLedger::Issued::Motion& motion,
                                const TableAngles& angles) const noexcept {
  return image_shift(motion.world_from_rendered,
                     plan_.follower.table.world_from_projector(motion.world_from_seeker, angles),
                     plan_.size_px, plan_.focal_px)
      .shift_px;
}

void MotionView::place(RenderJob& job, FrameLedger::Issued& issued,
                       std::int64_t display_ns) noexcept {
  take_reports();
  bool known = true;
  issued.motion.world_from_seeker = glm::mat3_cast(job.request.sensor_pose.world_from_body);
  issued.motion.world_from_rendered = issued.motion.world_from_seeker;
  issued.header.display_ns = display_ns;
  if (plan_.projects) {
    issued.motion.world_from_rendered = plan_.follower.table.world_from_projector(
        issued.motion.world_from_seeker, angles_at(display_ns, known));
    job.request.sensor_pose.world_from_body =
        glm::normalize(glm::quat_cast(issued.motion.world_from_rendered));
  }
  issued.motion.faults = faults_;
  if (!known) issued.motion.faults |= protocol::kMotionNoFeedback;
}

void MotionView::finish(FrameLedger::Issued& issued) noexcept {
  take_reports();
  finished_ = issued.motion;
  write(issued.header, finished_, issued.header.display_ns);
}

void MotionView::finish_repeat(FrameHeader& header, std::int64_t display_ns) noexcept {
  take_reports();
  header.display_ns = display_ns;
  finished_.faults = 0;
  write(header, finished_, display_ns);
}

void MotionView::write(FrameHeader& header, const FrameLedger::Issued::Motion& motion,
                       std::int64_t display_ns) noexcept {
  header.motion_state = state_;
  header.motion_faults = static_cast<std::uint8_t>(motion.faults | faults_);
  header.shift_x_px = 0.0F;
  header.shift_y_px = 0.0F;
  if (plan_.projects) {
    bool known = true;
    const glm::dvec2 shift = shift_px(motion, angles_at(display_ns, known));
    if (!known) header.motion_faults |= protocol::kMotionNoFeedback;
    header.shift_x_px = static_cast<float>(shift.x);
    header.shift_y_px = static_cast<float>(shift.y);
    header.pointing_error_px =
        static_cast<float>(pointing_error_px_.value_or(std::numeric_limits<double>::quiet_NaN()));
    if (shown_count_ == kKept) {
      first_shown_ = (first_shown_ + 1) % kKept;
      --shown_count_;
    }
    shown_[(first_shown_ + shown_count_++) % kKept] = {display_ns, motion, shift, follows(header)};
  }
  header.flags &= ~std::uint32_t{protocol::kFlagMotionFault};
  if (!follows(header)) header.flags |= protocol::kFlagMotionFault;
}

void MotionView::judge_shown() noexcept {
  const AxisFeedback* latest = track_.latest();
  while (shown_count_ > 0 && latest != nullptr) {
    const Shown& shown = shown_[first_shown_];
    if (latest->time_ns < shown.display_ns) break;
    bool known = true;
    const TableAngles angles = angles_at(shown.display_ns, known);
    if (known && shown.follows) {
      pointing_error_px_ = glm::distance(shift_px(shown.motion, angles), shown.shift_px);
      context_.motion_times.pointing.record(*pointing_error_px_);
    }
    first_shown_ = (first_shown_ + 1) % kKept;
    --shown_count_;
  }
}

}  // namespace emit::server
