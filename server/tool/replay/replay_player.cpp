// SPDX-License-Identifier: Apache-2.0
#include "tool/replay/replay_player.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "emit/protocol/control.hpp"
#include "tool/command_line/common_options.hpp"

namespace emit::tool {
namespace {

template <class Number>
std::optional<Number> number_of(std::string_view text) {
  Number value{};
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// Returns a position in ns; empty: it is none, or beyond what a log can hold.
std::optional<std::int64_t> position_ns(std::string_view text) {
  constexpr double kMostS = 1e9;
  const auto value_s = number_of<double>(text);
  if (!value_s || !(*value_s >= 0.0 && *value_s <= kMostS)) return std::nullopt;
  return std::llround(1e9 * *value_s);
}

}  // namespace

ReplayPlayer::Answer ReplayPlayer::take(std::string_view words) {
  const std::size_t end = std::min(words.find(' '), words.size());
  const std::string_view verb = words.substr(0, end);
  const std::string_view rest = words.substr(std::min(end + 1, words.size()));
  if (verb == "play" && rest.empty()) {
    // Nothing follows the last frame, so that it begins again.
    if (!target_ && shown_ && *shown_ + 1 == timeline_.frames().size()) target_ = 0;
    playing_ = true;
    steps_ = 0;
    anchor_.reset();
    return {true, "plays"};
  }
  if (verb == "hold" && rest.empty()) {
    playing_ = false;
    steps_ = 0;
    return {true, "holds"};
  }
  if (verb == "step" && rest.empty()) {
    // The refusal is that of emitd.
    if (playing_) {
      return {false,
              protocol::status_text(protocol::StatusCode::not_allowed,
                                    static_cast<std::uint64_t>(protocol::CommandKind::step))};
    }
    ++steps_;
    return {true, "steps"};
  }
  if (verb == "begin" && rest.empty()) return seek(0);
  if (verb == "seek") {
    const auto at_ns = position_ns(rest);
    if (!at_ns) return {false, fmt::format("seek {}: not a position in seconds", rest)};
    return seek(timeline_.frame_at(*at_ns));
  }
  if (verb == "move") {
    const auto by = number_of<std::int64_t>(rest);
    constexpr std::int64_t kMost = 1'000'000'000;
    if (!by || std::abs(*by) > kMost) return {false, fmt::format("move {}: not a number", rest)};
    const auto last = static_cast<std::int64_t>(timeline_.frames().size()) - 1;
    const auto from = static_cast<std::int64_t>(target_.value_or(shown_.value_or(0)));
    return seek(static_cast<std::size_t>(std::clamp(from + *by, std::int64_t{0}, last)));
  }
  if (verb == "rate") return take_rate(rest);
  if (verb == "loop") return take_loop(rest);
  return {false, fmt::format("{}: a replay does not know this word", words)};
}

ReplayPlayer::Answer ReplayPlayer::seek(std::size_t frame) {
  target_ = frame;
  steps_ = 0;
  const RecordingTimeline::Frame& to = timeline_.frames()[frame];
  return {true, fmt::format("seeks simulation time {:.3f} s", in_seconds(to.sim_time_ns))};
}

ReplayPlayer::Answer ReplayPlayer::take_rate(std::string_view text) {
  const auto rate = parse_speed(std::string(text));
  if (!rate) return {false, fmt::format("rate {}: a positive number or max", text)};
  rate_ = *rate;
  anchor_.reset();
  return {true, *rate > 0.0 ? fmt::format("{:g} times the recorded pace", *rate)
                            : std::string("as fast as it goes")};
}

ReplayPlayer::Answer ReplayPlayer::take_loop(std::string_view text) {
  if (text == "off") {
    loop_.reset();
    return {true, "plays to the end"};
  }
  const std::size_t end = std::min(text.find(' '), text.size());
  const auto from_ns = position_ns(text.substr(0, end));
  const auto to_ns = position_ns(text.substr(std::min(end + 1, text.size())));
  if (!from_ns || !to_ns)
    return {false, fmt::format("loop {}: not two positions in seconds", text)};
  const Loop loop{timeline_.frame_at(*from_ns), timeline_.frame_at(*to_ns)};
  if (loop.from >= loop.to) return {false, "a loop ends behind its begin"};
  loop_ = loop;
  return {true, fmt::format("plays from {:.3f} s to {:.3f} s again and again",
                            in_seconds(timeline_.frames()[loop.from].position_ns),
                            in_seconds(timeline_.frames()[loop.to].position_ns))};
}

ReplayPlayer::Order ReplayPlayer::show(std::size_t frame, std::int64_t now_ns, bool anchor) {
  if (anchor) anchor_ = Anchor{timeline_.frames()[frame].position_ns, now_ns};
  return {Order::Kind::show};
}

ReplayPlayer::Order ReplayPlayer::next(std::size_t frame, std::int64_t now_ns) {
  if (target_) {
    if (frame < *target_) return {Order::Kind::pass};
    if (frame > *target_) return {Order::Kind::anew};
    target_.reset();
    return show(frame, now_ns, true);
  }
  const std::size_t count = timeline_.frames().size();
  if (playing_ && loop_ && (frame > loop_->to || frame == count)) {
    target_ = loop_->from;
    return next(frame, now_ns);
  }
  if (frame == count) {
    playing_ = false;
    steps_ = 0;
    return {Order::Kind::wait};
  }
  if (steps_ > 0) {
    --steps_;
    return show(frame, now_ns, false);
  }
  if (!playing_) return {Order::Kind::wait};
  if (rate_ == 0.0) return show(frame, now_ns, false);
  if (!anchor_) return show(frame, now_ns, true);
  const auto after_ns =
      static_cast<double>(timeline_.frames()[frame].position_ns - anchor_->position_ns);
  const std::int64_t due_ns = anchor_->clock_ns + std::llround(after_ns / rate_);
  if (now_ns < due_ns) return {Order::Kind::wait, due_ns};
  return show(frame, now_ns, false);
}

std::string ReplayPlayer::json(std::size_t reached) const {
  const auto position_s = [this](std::size_t frame) {
    const auto& frames = timeline_.frames();
    return in_seconds(frames[std::min(frame, frames.size() - 1)].position_ns);
  };
  std::string out =
      fmt::format(R"({{"playing":{},"rate":{},"frame":{},"position_s":{:.9f},)", playing_, rate_,
                  shown_ ? fmt::to_string(*shown_) : "null", position_s(shown_.value_or(0)));
  out += fmt::format(R"("sim_time_s":{:.9f},)",
                     in_seconds(timeline_.frames()[shown_.value_or(0)].sim_time_ns));
  out += target_ ? fmt::format(R"("target_s":{:.9f},"reached_s":{:.9f},)", position_s(*target_),
                               position_s(reached))
                 : std::string(R"("target_s":null,"reached_s":null,)");
  out += loop_ ? fmt::format(R"("loop_s":[{:.9f},{:.9f}]}})", position_s(loop_->from),
                             position_s(loop_->to))
               : std::string(R"("loop_s":null})");
  return out;
}

}  // namespace emit::tool
