// SPDX-License-Identifier: Apache-2.0
#include "axes/acutrol_host.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"

namespace emit::server {
namespace {

using physics::kDegree;
using protocol::AxesMode;
using protocol::AxesState;

/// Share of rate and acceleration with which the axes park.
constexpr double kParkShare = 0.2;
/// Longest and shortest step on the way to the park positions.
constexpr double kLongestStepS = 0.1;
constexpr double kShortestStepS = 1e-4;
/// Differences below which a planned motion has come to its end.
constexpr double kEndRad = 1e-4;
constexpr double kEndRadS = 1e-2;
/// Measured axes may be so far from where they park.
constexpr double kParkedRad = 0.01;
/// Measured axes may be so far, and so late, behind their demands when they begin to follow.
constexpr double kCapturedRad = 0.02;
constexpr double kCapturedS = 0.05;
/// Interlocks may take so long to close.
constexpr std::int64_t kClosingNs = 5'000'000'000;
/// Digits of an angle behind the point: 1e-6 degrees are 0.004 arcsec.
constexpr int kDigits = 6;

constexpr unsigned bit(std::size_t axis) noexcept {
  return 1U << axis;
}

}  // namespace

physics::Result<AcutrolHost> AcutrolHost::create(const std::vector<Axis>& axes, Counters& counters,
                                                 EventLog& events) {
  if (axes.empty() || axes.size() > kMaxAxes) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               "a motion simulator has one to five axes");
  }
  std::vector<AxisProfile> profiles;
  for (const Axis& axis : axes) {
    auto profile = AxisProfile::create(axis.limits);
    if (!profile) return tl::unexpected(std::move(profile.error()));
    profiles.push_back(*profile);
  }
  return AcutrolHost(axes, std::move(profiles), counters, events);
}

AcutrolHost::AcutrolHost(const std::vector<Axis>& axes, std::vector<AxisProfile> profiles,
                         Counters& counters, EventLog& events)
    : axes_(axes), profiles_(std::move(profiles)), counters_(counters), events_(events) {}

void AcutrolHost::start() noexcept {
  splitter_.clear();
  expected_count_ = 0;
  order_lost_ = false;
  starting_ = false;
  off_done_ = off_bad_ = off_by_host_ = false;
  off_left_ = 0;
  started_ = powered_ = measured_once_ = false;
  known_interlocks_ = 0;
  ready_.reset();
  if (state_ != AxesState::fault) state_ = AxesState::motors_off;
}

// Lines

void AcutrolHost::write(std::string_view text) noexcept {
  EMIT_CHECK_OP(text_size_ + text.size(), <=, text_.size());
  std::ranges::copy(text, text_.begin() + static_cast<std::ptrdiff_t>(text_size_));
  text_size_ += text.size();
}

void AcutrolHost::expect(Expected::What what, std::size_t axis) noexcept {
  EMIT_CHECK_OP(expected_count_, <, expected_.size());
  expected_[(expected_first_ + expected_count_) % expected_.size()] = {what, axis};
  ++expected_count_;
}

void AcutrolHost::add(Expected::What what, std::string_view verb, std::size_t axis) noexcept {
  const char number = static_cast<char>('1' + axis);
  write(verb);
  write({&number, 1});
  write("\r\n");
  expect(what, axis);
}

void AcutrolHost::add_demand(Expected::What what, std::size_t axis) noexcept {
  std::array<char, 40> digits;
  const auto [end, error] =
      std::to_chars(digits.data(), digits.data() + digits.size(),
                    demanded_[axis].angle_rad / kDegree, std::chars_format::fixed, kDigits);
  EMIT_CHECK(error == std::errc());
  const char number = static_cast<char>('1' + axis);
  write(":D:P ");
  write({&number, 1});
  write(",");
  write({digits.data(), static_cast<std::size_t>(end - digits.data())});
  write("\r\n");
  expect(what, axis);
}

void AcutrolHost::add_off() noexcept {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    add(Expected::What::off, ":mode:off ", i);
    add(Expected::What::off, ":interlock:open ", i);
  }
  off_left_ = 2 * axes_.size();
  // The controller froze its state at the fault. Only the host may have it freed.
  if (off_wanted_ && state_ == AxesState::fault) {
    write(":interlock:reset\r\n");
    expect(Expected::What::off, 0);
    ++off_left_;
  }
  off_by_host_ = std::exchange(off_wanted_, false);
  off_bad_ = false;
  powered_ = started_ = starting_ = false;
}

void AcutrolHost::add_start() noexcept {
  // Demand where each axis is before its motor is on, so that it stays there.
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    demanded_[i] = {measured_[i].angle_rad, 0.0, 0.0};
    add_demand(Expected::What::start, i);
    add(Expected::What::start, ":mode:position ", i);
    add(Expected::What::start, ":interlock:close ", i);
  }
  starting_ = true;
  off_done_ = false;
}

void AcutrolHost::add_reads(bool with_demands) noexcept {
  // Demands stand between the reads: an answer too many is then found by its kind.
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    if (with_demands) add_demand(Expected::What::demand, i);
    add(Expected::What::position, ":R:P ", i);
    add(Expected::What::rate, ":R:R ", i);
  }
  if (powered_) {
    add(Expected::What::interlock, ":interlock? ", next_interlock_);
    next_interlock_ = (next_interlock_ + 1) % axes_.size();
    return;
  }
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    add(Expected::What::interlock, ":interlock? ", i);
  }
}

std::string_view AcutrolHost::lines(const protocol::AxesCommand& command,
                                    std::int64_t now_ns) noexcept {
  text_size_ = 0;
  const bool off = command.mode == AxesMode::off;
  const bool off_is_said = off_left_ > 0 && off_by_host_;
  off_wanted_ = off_wanted_ || (off && !off_is_said && (!off_done_ || state_ == AxesState::fault));
  if (expected_count_ > 0) {
    if (off_wanted_ && off_left_ == 0) {
      add_off();
    } else {
      counters_.add(Counter::axes_rounds_left_out);
    }
    return {text_.data(), text_size_};
  }
  sent_ns_ = now_ns;
  command_counter_ = command.counter;
  positions_ = rates_ = 0;
  round_is_bad_ = false;
  ready_.reset();
  const bool fault = state_ == AxesState::fault;
  if (off_wanted_ || (fault && !off_done_)) {
    add_off();
  } else if (!off && !fault && powered_) {
    plan(command, now_ns);
  } else if (!off && !fault && !started_ && measured_once_ &&
             known_interlocks_ == bit(axes_.size()) - 1) {
    add_start();
  }
  add_reads(powered_);
  return {text_.data(), text_size_};
}

void AcutrolHost::plan(const protocol::AxesCommand& command, std::int64_t now_ns) noexcept {
  const double step_s =
      std::clamp(1e-9 * static_cast<double>(now_ns - planned_ns_), kShortestStepS, kLongestStepS);
  planned_ns_ = now_ns;
  const bool followed = state_ == AxesState::capturing || state_ == AxesState::following;
  if (command.mode == AxesMode::follow && command.count == axes_.size()) {
    if (!followed) state_ = AxesState::capturing;
    demanded_ = command.axes;
    return;
  }
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    if (followed) profiles_[i].start(demanded_[i].angle_rad, demanded_[i].rate_rad_s);
    demanded_[i] = profiles_[i].step({axes_[i].park_rad, 0.0, 0.0}, step_s, kParkShare).motion;
  }
  if (followed) state_ = AxesState::parking;
}

// Answers

void AcutrolHost::take(std::string_view bytes, std::int64_t now_ns) noexcept {
  while (splitter_.next(bytes)) {
    answer(splitter_.line(), now_ns);
  }
}

void AcutrolHost::answer(std::string_view line, std::int64_t now_ns) noexcept {
  if (expected_count_ == 0) {
    // An answer to nothing may have shifted those before it.
    refuse();
    ready_.reset();
    return;
  }
  const Expected to = expected_[expected_first_];
  expected_first_ = (expected_first_ + 1) % expected_.size();
  --expected_count_;
  const AcutrolAnswer answer = parse_acutrol_answer(line);
  switch (to.what) {
    case Expected::What::demand:
    case Expected::What::start:
      answer_to_command(to, answer.kind, line);
      break;
    case Expected::What::off:
      answer_to_command(to, answer.kind, line);
      if (--off_left_ == 0) end_off();
      break;
    case Expected::What::position:
    case Expected::What::rate:
      answer_to_read(to, answer, line, now_ns);
      break;
    case Expected::What::interlock:
      answer_to_interlock(to.axis, answer.kind, line);
      break;
  }
  if (expected_count_ == 0) end_round(now_ns);
}

void AcutrolHost::answer_to_command(const Expected& to, AcutrolAnswer::Kind kind,
                                    std::string_view line) noexcept {
  if (kind == AcutrolAnswer::Kind::ok) return;
  if (kind == AcutrolAnswer::Kind::number) {
    lose_order();
    return;
  }
  if (to.what == Expected::What::off) off_bad_ = true;
  fail(to.axis, line);
}

void AcutrolHost::answer_to_read(const Expected& to, const AcutrolAnswer& answer,
                                 std::string_view line, std::int64_t now_ns) noexcept {
  if (answer.kind == AcutrolAnswer::Kind::ok) {
    lose_order();
    return;
  }
  if (answer.kind == AcutrolAnswer::Kind::error) {
    fail(to.axis, line);
    return;
  }
  const double value = answer.value * kDegree;
  const bool is_angle = to.what == Expected::What::position;
  const double most = is_angle ? protocol::kMaxAxisRad : protocol::kMaxAxisRadS;
  if (answer.kind != AcutrolAnswer::Kind::number || !(std::abs(value) <= most)) {
    refuse();
    return;
  }
  (is_angle ? fresh_[to.axis].angle_rad : fresh_[to.axis].rate_rad_s) = value;
  (is_angle ? positions_ : rates_) |= bit(to.axis);
  read_ns_ = now_ns;
}

void AcutrolHost::answer_to_interlock(std::size_t axis, AcutrolAnswer::Kind kind,
                                      std::string_view line) noexcept {
  using Kind = AcutrolAnswer::Kind;
  closed_interlocks_ &= ~bit(axis);
  switch (kind) {
    case Kind::closed:
      known_interlocks_ |= bit(axis);
      closed_interlocks_ |= bit(axis);
      break;
    case Kind::open:
      known_interlocks_ |= bit(axis);
      if (powered_) fail(axis, line);
      break;
    case Kind::fault:
    case Kind::error:
      fail(axis, line);
      break;
    case Kind::ok:
    case Kind::number:
      lose_order();
      break;
    case Kind::other:
      refuse();
      break;
  }
}

void AcutrolHost::refuse() noexcept {
  counters_.add(Counter::axes_reports_refused);
  round_is_bad_ = true;
}

void AcutrolHost::lose_order() noexcept {
  refuse();
  order_lost_ = true;
}

void AcutrolHost::fail(std::size_t axis, std::string_view line) noexcept {
  faulty_axes_ |= bit(axis);
  powered_ = started_ = starting_ = false;
  if (state_ == AxesState::fault) return;
  state_ = AxesState::fault;
  off_done_ = false;
  events_.push(EventKind::axes_refused, axis + 1, 0, line);
}

void AcutrolHost::end_off() noexcept {
  if (off_bad_) return;
  off_done_ = true;
  known_interlocks_ = 0;
  if (!off_by_host_) return;
  state_ = AxesState::motors_off;
  faulty_axes_ = 0;
}

void AcutrolHost::end_round(std::int64_t now_ns) noexcept {
  const unsigned all = bit(axes_.size()) - 1;
  if (std::exchange(starting_, false) && !round_is_bad_) {
    started_ = true;
    started_ns_ = now_ns;
  }
  if (started_ && !powered_) power_on(all, now_ns);
  if (round_is_bad_ || positions_ != all || rates_ != all) return;
  measured_ = fresh_;
  measured_once_ = true;
  note_arrival();
  ready_ = protocol::AxesMonitor{++counter_,
                                 sent_ns_ + (read_ns_ - sent_ns_) / 2,
                                 command_counter_,
                                 state_,
                                 0,
                                 faulty_axes_,
                                 false,
                                 axes_.size(),
                                 measured_,
                                 demanded_};
}

void AcutrolHost::power_on(unsigned all, std::int64_t now_ns) noexcept {
  if (closed_interlocks_ != all) {
    // Drives take their time to be enabled.
    if (now_ns - started_ns_ > kClosingNs) {
      fail(static_cast<std::size_t>(std::countr_one(closed_interlocks_)), "interlock stays open");
    }
    return;
  }
  powered_ = true;
  state_ = AxesState::parking;
  planned_ns_ = now_ns;
  for (std::size_t i = 0; i < axes_.size(); ++i) profiles_[i].start(demanded_[i].angle_rad);
}

void AcutrolHost::note_arrival() noexcept {
  bool arrived = powered_;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const double behind_rad = std::abs(measured_[i].angle_rad - demanded_[i].angle_rad);
    if (state_ == AxesState::parking) {
      arrived = arrived && behind_rad < kParkedRad &&
                std::abs(demanded_[i].angle_rad - axes_[i].park_rad) < kEndRad &&
                std::abs(demanded_[i].rate_rad_s) < kEndRadS;
    } else {
      arrived =
          arrived && behind_rad < kCapturedRad + kCapturedS * std::abs(demanded_[i].rate_rad_s);
    }
  }
  if (!arrived) return;
  if (state_ == AxesState::parking) state_ = AxesState::parked;
  if (state_ == AxesState::capturing) state_ = AxesState::following;
}

}  // namespace emit::server
