// SPDX-License-Identifier: Apache-2.0
#include "agents/motion/motion_agent.hpp"

#include <algorithm>

namespace emit::server {
namespace {

/// Messages taken in a turn, so that a flood does not delay the commands.
constexpr int kMostPerTurn = 64;

}  // namespace

bool MotionAgent::on_start() noexcept {
  due_ns_ = context_.clock.tai_ns() + period_ns_;
  return true;
}

int MotionAgent::do_work(std::int64_t now_ns) noexcept {
  int work = take_poses(now_ns) + take_monitors(now_ns);
  // Somebody has set the clock back: the next command is not due in hours.
  if (due_ns_ - now_ns > 2 * period_ns_) {
    due_ns_ = now_ns;
  }
  if (now_ns >= due_ns_) {
    command(now_ns);
    ++work;
  }
  return work;
}

int MotionAgent::take_poses(std::int64_t now_ns) noexcept {
  int work = 0;
  for (; work < kMostPerTurn; ++work) {
    const MotionInput* input = context_.motion_inputs.front();
    if (input == nullptr) break;
    switch (input->kind) {
      case MotionInput::Kind::forget:
        follower_.forget();
        break;
      case MotionInput::Kind::reset:
        follower_.reset(now_ns);
        break;
      case MotionInput::Kind::target:
        follower_.take(input->target);
        break;
      case MotionInput::Kind::pose:
        if (!follower_.take(input->pose, input->received_ns)) {
          context_.counters.add(Counter::axes_clock_jumps);
        }
        break;
    }
    context_.motion_inputs.pop();
  }
  return work;
}

int MotionAgent::take_monitors(std::int64_t now_ns) noexcept {
  int work = 0;
  for (; work < kMostPerTurn; ++work) {
    const auto monitor = link_->receive(now_ns);
    if (!monitor) break;
    const auto feedback = follower_.take(*monitor, now_ns);
    if (!feedback) {
      context_.counters.add(Counter::axes_reports_refused);
      continue;
    }
    context_.counters.add(Counter::axes_reports);
    context_.motion_times.age.record(now_ns - feedback->time_ns);
    if (follower_.status().state == protocol::MotionState::following) {
      context_.motion_times.error.record(follower_.error_rad());
    }
    report(&*feedback);
    show(*feedback);
  }
  return work;
}

void MotionAgent::command(std::int64_t now_ns) noexcept {
  context_.motion_times.late.record(now_ns - due_ns_);
  const protocol::AxesCommand& command = follower_.step(now_ns);
  link_->send(command, now_ns);
  show(command);
  // Commands that are due already are left out: the axes need the newest one alone.
  const std::int64_t missed = (now_ns - due_ns_) / period_ns_;
  if (missed > 0) {
    context_.counters.add(Counter::axes_commands_missed, static_cast<std::uint64_t>(missed));
  }
  due_ns_ += (missed + 1) * period_ns_;
  note_status();
}

void MotionAgent::show(const protocol::AxesCommand& command) noexcept {
  AxesBoard& board = context_.axes;
  for (std::size_t i = 0; i < command.count; ++i) {
    board.commanded_rad[i].store(command.axes[i].angle_rad, std::memory_order_relaxed);
  }
  if (command.count > 0) board.count.store(command.count, std::memory_order_relaxed);
}

void MotionAgent::show(const AxisFeedback& feedback) noexcept {
  AxesBoard& board = context_.axes;
  const TableAngles& angles = feedback.angles;
  const std::array<double, protocol::kMaxAxes> measured{angles.unit_rad.x, angles.unit_rad.y,
                                                        angles.unit_rad.z, angles.target_rad.x,
                                                        angles.target_rad.y};
  for (std::size_t i = 0; i < measured.size(); ++i) {
    board.measured_rad[i].store(measured[i], std::memory_order_relaxed);
  }
  board.measured_ns.store(feedback.time_ns, std::memory_order_relaxed);
  if (!board.watched.load(std::memory_order_relaxed)) return;
  // A clock that was set back begins anew.
  const std::int64_t since_ns = feedback.time_ns - ticked_ns_;
  if (since_ns >= 0 && since_ns < kAxesTickNs) return;
  AxesTick* tick = context_.axes_ticks.claim();
  if (tick == nullptr) return;  // a page that does not look loses ticks, and nobody waits for it
  ticked_ns_ = feedback.time_ns;
  const std::span<const double> asked_rad = follower_.asked_rad();
  tick->time_ns = feedback.time_ns;
  tick->count = static_cast<std::uint8_t>(board.count.load(std::memory_order_relaxed));
  tick->driven = !asked_rad.empty();
  tick->measured_rad = measured;
  std::ranges::copy(asked_rad, tick->demanded_rad.begin());
  context_.axes_ticks.commit();
}

void MotionAgent::note_status() noexcept {
  const TableFollower::Status& now = follower_.status();
  context_.axes.state.store(static_cast<std::uint8_t>(now.state), std::memory_order_relaxed);
  context_.axes.faults.store(now.faults, std::memory_order_relaxed);
  const bool changed = now.state != known_.state || now.faults != known_.faults;
  // Limits and locks come and go with every manoeuvre: they are counted, not logged.
  constexpr unsigned kCounted = protocol::kMotionLimit | protocol::kMotionLock;
  const bool logged = now.state != known_.state || ((now.faults ^ known_.faults) & ~kCounted) != 0;
  const auto began = [&](protocol::MotionFaults fault) {
    return (now.faults & ~known_.faults & fault) != 0;
  };
  if (began(protocol::kMotionNoFeedback)) context_.counters.add(Counter::axes_feedback_losses);
  if (began(protocol::kMotionNoHost)) context_.counters.add(Counter::axes_host_silences);
  if (began(protocol::kMotionIgnored)) context_.counters.add(Counter::axes_commands_ignored);
  if (began(protocol::kMotionInterlock)) context_.counters.add(Counter::axes_interlocks);
  if ((now.faults & protocol::kMotionLimit) != 0) {
    context_.counters.add(Counter::axes_commands_limited);
  }
  if (logged) {
    context_.motion_events.push(EventKind::motion_changed, static_cast<std::uint64_t>(now.state),
                                now.faults);
  }
  known_ = now;
  // A status without a measurement has to reach the conductor too.
  if (changed || !reported_) report(nullptr);
  reported_ = false;
}

void MotionAgent::report(const AxisFeedback* feedback) noexcept {
  if (feedback != nullptr && context_.shifts_pictures && !context_.shift_feedback.push(*feedback)) {
    context_.counters.add(Counter::shift_feedback_dropped);
  }
  MotionReport* out = context_.motion_reports.claim();
  if (out == nullptr) {
    context_.counters.add(Counter::axes_reports_dropped);
    return;
  }
  out->at_ns = context_.clock.tai_ns();
  out->has_feedback = feedback != nullptr;
  if (feedback != nullptr) out->feedback = *feedback;
  out->state = follower_.status().state;
  out->faults = follower_.status().faults;
  context_.motion_reports.commit();
  reported_ = true;
  // The conductor looks at each frame. It is woken only when it has not looked for long.
  if (context_.motion_reports.free() < context_.motion_reports.capacity() / 2) {
    context_.bells.conductor.ring();
  }
}

void MotionAgent::on_stop() noexcept {
  const std::int64_t now_ns = context_.clock.tai_ns();
  follower_.reset(now_ns);
  link_->send(follower_.step(now_ns), now_ns);
}

}  // namespace emit::server
