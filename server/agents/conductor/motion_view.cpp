// SPDX-License-Identifier: Apache-2.0
#include "agents/conductor/motion_view.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <utility>

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
  if (pending_ != MotionInput::Kind::reset) pending_ = MotionInput::Kind::forget;
  push_pending();
}

void MotionView::reset() noexcept {
  pending_ = MotionInput::Kind::reset;
  push_pending();
}

void MotionView::push_pending() noexcept {
  if (pending_ == MotionInput::Kind::pose) return;
  MotionInput* out = context_.motion_inputs.claim();
  if (out == nullptr) return;
  *out = {};
  out->kind = std::exchange(pending_, MotionInput::Kind::pose);
  context_.motion_inputs.commit();
  context_.bells.motion.ring();
}

void MotionView::push(const MotionInput& input) noexcept {
  push_pending();
  if (pending_ != MotionInput::Kind::pose || !context_.motion_inputs.push(input)) {
    context_.counters.add(Counter::axes_inputs_dropped);
    return;
  }
  context_.bells.motion.ring();
}

void MotionView::take_target(const protocol::HostFrameData& frame) noexcept {
  if (!plan_.target_entity) return;
  MotionInput input;
  input.kind = MotionInput::Kind::target;
  input.target.sim_time_ns = frame.sim_time_ns;
  const scene::TrajectoryState scripted =
      scenario_.entity_at(*plan_.target_entity, frame.sim_time_ns);
  bool come = !target_moved_ && scenario_.has_entities();
  input.target.position_m = scripted.pose.position_world_m;
  for (const protocol::EntityStateData& entity : frame.entity_span()) {
    if (entity.entity_id != *plan_.target_entity) continue;
    // The first state of the host ends the scripted motion.
    come = !target_moved_ || entity.has_pose;
    input.target.teleport = entity.teleport || !target_moved_;
    target_moved_ = true;
    if (!entity.has_pose) continue;
    input.target.position_m = entity.pose.position_world_m;
    if (entity.rates) input.target.velocity_m_s = entity.rates->velocity_world_m_s;
  }
  if (come) push(input);
}

void MotionView::take_pose(const protocol::HostFrameData& frame) noexcept {
  MotionInput input;
  input.received_ns = frame.received_ns;
  input.pose = {frame.sim_time_ns, frame.seeker, frame.seeker_rates};
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
    reported_ns_ = report->at_ns;
    context_.motion_reports.pop();
  }
  if (taken > 0) judge_shown();
  push_pending();
  // An agent that does not come to its turn leaves the axes to the controller.
  if (context_.clock.tai_ns() - reported_ns_ > plan_.follower.feedback_timeout_ns) {
    state_ = MotionState::waiting;
    faults_ |= protocol::kMotionNoFeedback;
  }
  return taken;
}

TableAngles MotionView::angles_at(std::int64_t time_ns, bool& known) const noexcept {
  const auto state = track_.at(time_ns, plan_.follower.horizon_ns);
  known = state.has_value();
  if (state) return state->angles;
  const AxisFeedback* latest = track_.latest();
  return latest != nullptr ? latest->angles : TableAngles{};
}

glm::dvec2 MotionView::shift_px(const ShownAttitude& attitude,
                                std::int64_t display_ns) const noexcept {
  bool known = true;
  const TableAngles angles = angles_at(display_ns, known);
  return known ? image_shift_px(plan_, attitude, angles)
               : glm::dvec2(std::numeric_limits<double>::quiet_NaN());
}

void MotionView::place(RenderJob& job, FrameLedger::Issued& issued,
                       std::int64_t display_ns) noexcept {
  take_reports();
  bool known = true;
  if (plan_.projects) issued.header.display_ns = display_ns;
  issued.motion.attitude = attitude_at(job.request.sensor_pose, display_ns, known);
  job.attitude = issued.motion.attitude;
  job.display_ns = display_ns;
  issued.motion.faults = faults_;
  if (!known) issued.motion.faults |= protocol::kMotionNoFeedback;
}

void MotionView::place_ahead(RenderJob& job, FrameLedger::Issued& issued,
                             const physics::Pose& sensor_pose, std::int64_t display_ns) noexcept {
  // Whether the axes are known so far ahead is judged when the image is finished.
  bool known = true;
  FrameLedger::Issued::Ahead& ahead = issued.ahead;
  if (plan_.projects) ahead.image.display_ns = display_ns;
  ahead.motion.attitude = attitude_at(sensor_pose, display_ns, known);
  ahead.motion.faults = issued.motion.faults;
  job.ahead.attitude = ahead.motion.attitude;
  job.ahead.display_ns = display_ns;
}

ShownAttitude MotionView::attitude_at(const physics::Pose& sensor_pose, std::int64_t display_ns,
                                      bool& known) const noexcept {
  ShownAttitude attitude;
  attitude.world_from_seeker = glm::mat3_cast(sensor_pose.world_from_body);
  attitude.world_from_rendered = attitude.world_from_seeker;
  if (plan_.projects) {
    attitude.world_from_rendered = plan_.follower.table.world_from_projector(
        attitude.world_from_seeker, angles_at(display_ns, known));
  }
  return attitude;
}

void MotionView::finish(FrameLedger::Issued& issued, const RenderDone& done) noexcept {
  take_reports();
  finished_ = issued.motion;
  applied_px_ = done.image.shift_px;
  glm::dvec2 shift(std::numeric_limits<double>::quiet_NaN());
  if (!context_.shifts_pictures) {
    shift = shift_px(finished_.attitude, issued.header.display_ns);
  } else if (done.shift_known) {
    shift = done.image.shift_px;
  }
  write(issued.header, finished_, shift);
  ahead_by_ns_ = 0;
  AheadImage& ahead = issued.ahead.image;
  if (ahead.display_ns == 0) return;
  finished_ahead_ = issued.ahead.motion;
  ahead_by_ns_ = ahead.display_ns - issued.header.display_ns;
  ahead.shift_px = done.image.ahead.shift_px;
  glm::dvec2 ahead_shift(std::numeric_limits<double>::quiet_NaN());
  if (!context_.shifts_pictures) {
    ahead_shift = shift_px(finished_ahead_.attitude, ahead.display_ns);
  } else if (done.ahead_shift_known) {
    ahead_shift = ahead.shift_px;
  }
  write_ahead(ahead, finished_ahead_, ahead_shift);
  ahead_ = ahead;
}

void MotionView::finish_repeat(FrameHeader& header, AheadImage& ahead,
                               std::int64_t display_ns) noexcept {
  take_reports();
  if (plan_.projects) header.display_ns = display_ns;
  write(header, finished_, shift_px(finished_.attitude, display_ns));
  if (ahead_by_ns_ == 0) return;
  ahead = ahead_;
  ahead.display_ns = display_ns + ahead_by_ns_;
  write_ahead(ahead, finished_ahead_, shift_px(finished_ahead_.attitude, ahead.display_ns));
}

void MotionView::write_ahead(AheadImage& ahead, const FrameLedger::Issued::Motion& motion,
                             const glm::dvec2& shift_px) const noexcept {
  const bool known = std::isfinite(shift_px.x + shift_px.y);
  ahead.wanted_shift_px = known ? glm::vec2(shift_px) : ahead.shift_px;
  ahead.flags &= ~std::uint32_t{protocol::kFlagMotionFault};
  if (!known || state_ != MotionState::following || (motion.faults | faults_) != 0) {
    ahead.flags |= protocol::kFlagMotionFault;
  }
}

void MotionView::write(FrameHeader& header, const FrameLedger::Issued::Motion& motion,
                       const glm::dvec2& shift_px) noexcept {
  header.motion_state = state_;
  header.motion_faults = static_cast<std::uint8_t>(motion.faults | faults_);
  header.shift_x_px = 0.0F;
  header.shift_y_px = 0.0F;
  header.pointing_error_px = std::numeric_limits<float>::quiet_NaN();
  if (plan_.projects) {
    // Nothing remains to be done beside what was applied, where the axes are not known.
    glm::vec2 wanted_px = applied_px_;
    if (std::isfinite(shift_px.x + shift_px.y)) {
      wanted_px = shift_px;
    } else {
      header.motion_faults |= protocol::kMotionNoFeedback;
    }
    header.shift_x_px = wanted_px.x;
    header.shift_y_px = wanted_px.y;
    if (pointing_error_px_) header.pointing_error_px = static_cast<float>(*pointing_error_px_);
    keep(header, motion, shift_px);
  }
  header.flags &= ~std::uint32_t{protocol::kFlagMotionFault};
  if (!follows(header)) header.flags |= protocol::kFlagMotionFault;
}

void MotionView::keep(const FrameHeader& header, const FrameLedger::Issued::Motion& motion,
                      const glm::dvec2& shift) noexcept {
  // A frame that is shown again, or whose pose is stale, is not where its seeker looks.
  constexpr std::uint32_t kOld = protocol::kFlagRepeated | protocol::kFlagStale;
  if (!follows(header) || (header.flags & kOld) != 0) return;
  if (shown_count_ == kKept) {
    first_shown_ = (first_shown_ + 1) % kKept;
    --shown_count_;
  }
  shown_[(first_shown_ + shown_count_++) % kKept] = {header.display_ns, motion, shift};
}

void MotionView::judge_shown() noexcept {
  const AxisFeedback* latest = track_.latest();
  while (shown_count_ > 0 && latest != nullptr) {
    const Shown& shown = shown_[first_shown_];
    if (latest->time_ns < shown.display_ns) break;
    bool known = true;
    const TableAngles angles = angles_at(shown.display_ns, known);
    if (known) {
      pointing_error_px_ =
          glm::distance(image_shift_px(plan_, shown.motion.attitude, angles), shown.shift_px);
      context_.motion_times.pointing.record(*pointing_error_px_);
    }
    first_shown_ = (first_shown_ + 1) % kKept;
    --shown_count_;
  }
}

}  // namespace emit::server
