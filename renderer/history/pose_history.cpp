// SPDX-License-Identifier: Apache-2.0
#include "history/pose_history.hpp"

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include <algorithm>
#include <cmath>

namespace emit::renderer {
namespace {

constexpr double kThinPositionM = 0.01;
constexpr double kThinAngleRad = 1e-3;
constexpr std::int64_t kThinSpanNs = 1'000'000'000;
constexpr double kMovingMPerS = 0.05;
constexpr double kSpotM = 0.02;
constexpr std::int64_t kRestNs = 500'000'000;

bool close(const physics::Pose& a, const physics::Pose& b) noexcept {
  return physics::close(a, b, kThinPositionM, kThinAngleRad);
}

double fraction(std::int64_t begin_ns, std::int64_t end_ns, std::int64_t at_ns) noexcept {
  return end_ns > begin_ns
             ? static_cast<double>(at_ns - begin_ns) / static_cast<double>(end_ns - begin_ns)
             : 1.0;
}

bool moves(const scene::Keyframe& from, const scene::Keyframe& to) noexcept {
  const double seconds = static_cast<double>(to.sim_time_ns - from.sim_time_ns) * 1e-9;
  return !to.teleport && seconds > 0.0 &&
         glm::distance(from.pose.position_world_m, to.pose.position_world_m) >
             kMovingMPerS * seconds;
}

/// Returns the length of the path along the keyframes between two instants, m.
double path_in(const scene::Trajectory& keys, std::int64_t begin_ns, std::int64_t end_ns) noexcept {
  double path_m = 0.0;
  auto next = std::upper_bound(
      keys.begin(), keys.end(), begin_ns,
      [](std::int64_t t, const scene::Keyframe& key) { return t < key.sim_time_ns; });
  if (next == keys.begin() && next != keys.end()) ++next;
  for (; next != keys.end() && (next - 1)->sim_time_ns < end_ns; ++next) {
    const scene::Keyframe& from = *(next - 1);
    if (next->teleport || !from.on) continue;
    const std::int64_t clipped_begin_ns = std::max(begin_ns, from.sim_time_ns);
    const std::int64_t clipped_end_ns = std::min(end_ns, next->sim_time_ns);
    if (clipped_end_ns <= clipped_begin_ns) continue;
    path_m += glm::distance(from.pose.position_world_m, next->pose.position_world_m) *
              (fraction(from.sim_time_ns, next->sim_time_ns, clipped_end_ns) -
               fraction(from.sim_time_ns, next->sim_time_ns, clipped_begin_ns));
  }
  return path_m;
}

}  // namespace

PoseHistory::PoseHistory(const scene::ObjectDesc& object, const physics::Pose& placement,
                         const physics::AirFilmBody& film_body)
    : film_body_(film_body), scripted_(object.trajectory) {
  live_.reserve(kMaxLivePoses);
  events_ns_.reserve(kMaxEvents);
  if (scripted_.empty()) {
    scripted_.push_back({.sim_time_ns = 0, .pose = placement, .on = object.on});
  }
  note_scripted_events();
}

void PoseHistory::note_scripted_events() noexcept {
  bool moving = false;
  for (std::size_t i = 1; i < scripted_.size(); ++i) {
    const scene::Keyframe& from = scripted_[i - 1];
    const scene::Keyframe& to = scripted_[i];
    const bool moving_now = moves(from, to);
    if (moving_now != moving) note_event(from.sim_time_ns);
    moving = moving_now;
    if (from.on != to.on || to.teleport) note_event(to.sim_time_ns);
  }
  if (moving) note_event(scripted_.back().sim_time_ns);
}

void PoseHistory::note_event(std::int64_t sim_time_ns) noexcept {
  const auto place = std::lower_bound(events_ns_.begin(), events_ns_.end(), sim_time_ns);
  if (place != events_ns_.end() && *place == sim_time_ns) return;
  if (events_ns_.size() < kMaxEvents) {
    events_ns_.insert(place, sim_time_ns);
  } else if (place != events_ns_.begin()) {
    std::move(events_ns_.begin() + 1, place, events_ns_.begin());  // drops the oldest event
    *(place - 1) = sim_time_ns;
  }
}

void PoseHistory::note_motion(const scene::Keyframe& last, const scene::Keyframe& next) noexcept {
  const bool on_spot =
      glm::distance(spot_.pose.position_world_m, next.pose.position_world_m) < kSpotM;
  if (next.teleport) {
    note_event(next.sim_time_ns);
    if (moving_) note_event(last.sim_time_ns);
    moving_ = false;
    spot_ = next;
  } else if (!on_spot) {
    if (!moving_) note_event(last.sim_time_ns);
    moving_ = true;
    spot_ = next;
  } else if (moving_ && next.sim_time_ns - spot_.sim_time_ns >= kRestNs) {
    note_event(spot_.sim_time_ns);
    moving_ = false;
  }
}

void PoseHistory::note_appearance(std::int64_t sim_time_ns) noexcept {
  appearances_ns_[appearance_count_++ % kMaxAppearances] = sim_time_ns;
}

std::optional<std::int64_t> PoseHistory::on_since_ns(std::int64_t sim_time_ns) const noexcept {
  // Take the latest appearance that the host caused, then that of the script before the host came.
  const std::size_t kept = std::min(appearance_count_, kMaxAppearances);
  for (std::size_t i = 1; i <= kept; ++i) {
    const std::int64_t at_ns = appearances_ns_[(appearance_count_ - i) % kMaxAppearances];
    if (at_ns <= sim_time_ns) return at_ns;
  }
  std::int64_t scripted_ns = sim_time_ns;
  if (!live_.empty()) scripted_ns = std::min(scripted_ns, live_.front().sim_time_ns);
  for (std::size_t i = scripted_.size(); i-- > 1;) {
    if (scripted_[i].sim_time_ns > scripted_ns) continue;
    if (scripted_[i].on && !scripted_[i - 1].on) return scripted_[i].sim_time_ns;
  }
  return std::nullopt;
}

bool PoseHistory::append(std::int64_t sim_time_ns, const physics::Pose& pose, bool on,
                         bool teleport) noexcept {
  if (!live_.empty() && sim_time_ns < live_.back().sim_time_ns) return false;
  forget();
  const scene::Keyframe next{
      .sim_time_ns = sim_time_ns, .pose = pose, .on = on, .teleport = teleport};
  if (live_.empty()) {
    // Drop the events of the script after this instant, because they will not happen.
    const TrajectoryState planned = trajectory_at(scripted_, sim_time_ns);
    while (!events_ns_.empty() && events_ns_.back() >= sim_time_ns) {
      events_ns_.pop_back();
    }
    if (planned.on != on || !close(planned.pose, pose)) note_event(sim_time_ns);
    if (on && !planned.on) note_appearance(sim_time_ns);
    live_.push_back(next);
    moving_ = false;
    spot_ = next;
    return true;
  }
  const scene::Keyframe& last = live_.back();
  if (on && !last.on) note_appearance(sim_time_ns);
  if (sim_time_ns == last.sim_time_ns) {
    live_.back() = next;
    return true;
  }
  note_motion(last, next);
  if (last.on != on) note_event(sim_time_ns);

  if (replaces_last(next)) {
    live_.back() = next;
    return true;
  }
  skipped_count_ = 0;
  skipped_stride_ = 1;
  skipped_phase_ = 0;
  if (live_.size() == kMaxLivePoses) make_room();
  live_.push_back(next);
  return true;
}

/// Returns true when `next` may replace the newest pose: the path from the pose before it to `next`
/// passes the newest pose and all poses thinned out in between.
bool PoseHistory::replaces_last(const scene::Keyframe& next) noexcept {
  if (live_.size() < 2) return false;
  const scene::Keyframe& before = live_[live_.size() - 2];
  const scene::Keyframe& last = live_.back();
  if (next.teleport || last.teleport || last.on != next.on || before.on != next.on) return false;
  const bool at_rest = close(before.pose, last.pose) && close(before.pose, next.pose);
  if (!at_rest && next.sim_time_ns - before.sim_time_ns > kThinSpanNs) return false;
  const auto fits = [&](const scene::Keyframe& key) {
    return close(
        physics::interpolate(before.pose, next.pose,
                             fraction(before.sim_time_ns, next.sim_time_ns, key.sim_time_ns)),
        key.pose);
  };
  if (!fits(last)) return false;
  for (std::size_t i = 0; i < skipped_count_; ++i) {
    if (!fits(skipped_[i])) return false;
  }
  if (++skipped_phase_ >= skipped_stride_) {
    skipped_phase_ = 0;
    if (skipped_count_ == skipped_.size()) {
      for (std::size_t i = 0; 2 * i + 1 < skipped_.size(); ++i) skipped_[i] = skipped_[2 * i + 1];
      skipped_count_ = skipped_.size() / 2;
      skipped_stride_ *= 2;
    }
    skipped_[skipped_count_++] = last;
  }
  return true;
}

/// Keeps the whole newer half and every other pose of the older half.
void PoseHistory::make_room() noexcept {
  const auto half = live_.begin() + kMaxLivePoses / 2;
  auto write = live_.begin() + 1;
  for (auto read = live_.begin() + 2; read < half; read += 2) *write++ = *read;
  dropped_ += static_cast<std::uint64_t>(half - write);
  live_.erase(write, half);
}

void PoseHistory::foresee(std::int64_t sim_time_ns, const physics::Pose& pose) noexcept {
  if (live_.empty() || sim_time_ns <= live_.back().sim_time_ns) return;
  foreseen_ = scene::Keyframe{.sim_time_ns = sim_time_ns, .pose = pose, .on = live_.back().on};
}

void PoseHistory::reset() noexcept {
  live_.clear();
  forget();
  appearance_count_ = 0;
  dropped_ = 0;
  skipped_count_ = 0;
  skipped_stride_ = 1;
  skipped_phase_ = 0;
  moving_ = false;
  // Live poses may have removed events of the script.
  events_ns_.clear();
  note_scripted_events();
}

TrajectoryState PoseHistory::at(std::int64_t sim_time_ns) const noexcept {
  TrajectoryState state = recorded_at(sim_time_ns);
  if (!foreseen_ || sim_time_ns <= live_.back().sim_time_ns) return state;
  const double way_frac = fraction(live_.back().sim_time_ns, foreseen_->sim_time_ns, sim_time_ns);
  state.pose = physics::interpolate(live_.back().pose, foreseen_->pose, std::min(1.0, way_frac));
  return state;
}

TrajectoryState PoseHistory::recorded_at(std::int64_t sim_time_ns) const noexcept {
  if (!live_.empty() && sim_time_ns >= live_.front().sim_time_ns) {
    return trajectory_at(live_, sim_time_ns);
  }
  return trajectory_at(scripted_, sim_time_ns);
}

TrajectoryState PoseHistory::ahead(std::int64_t sim_time_ns) const noexcept {
  TrajectoryState state = recorded_at(sim_time_ns);
  if (!moving_ || live_.size() < 2 || sim_time_ns <= live_.back().sim_time_ns) return state;
  const scene::Keyframe& before = live_[live_.size() - 2];
  const scene::Keyframe& last = live_.back();
  if (last.teleport || !last.on || last.sim_time_ns <= before.sim_time_ns) return state;
  const double ways = static_cast<double>(std::min(sim_time_ns - last.sim_time_ns, kMaxAheadNs)) /
                      static_cast<double>(last.sim_time_ns - before.sim_time_ns);
  state.pose.position_world_m += ways * (last.pose.position_world_m - before.pose.position_world_m);
  return state;
}

PoseHistory::Known PoseHistory::known() const noexcept {
  return live_.empty() ? Known{} : Known{true, live_.back()};
}

TrajectoryState PoseHistory::as_known(const Known& then, std::int64_t sim_time_ns) const noexcept {
  if (!then.live) return trajectory_at(scripted_, sim_time_ns);
  if (sim_time_ns >= then.newest.sim_time_ns) return {then.newest.pose, then.newest.on};
  return recorded_at(sim_time_ns);
}

bool PoseHistory::departs(const Known& then, std::int64_t sim_time_ns) const noexcept {
  if (live_.empty() && !then.live) return false;
  const TrajectoryState now = recorded_at(sim_time_ns);
  const TrajectoryState before = as_known(then, sim_time_ns);
  return now.on != before.on || (now.on && !close(now.pose, before.pose));
}

PoseHistory::Motion PoseHistory::motion(std::int64_t begin_ns, std::int64_t end_ns) const noexcept {
  constexpr std::int64_t kLatestNs = 1'000'000'000;
  if (!live_.empty() && live_.back().sim_time_ns < end_ns) {
    end_ns = live_.back().sim_time_ns;
    begin_ns = std::min(begin_ns, end_ns - kLatestNs);
  }
  const double way_m = path_m(begin_ns, end_ns);
  if (end_ns <= begin_ns || !(way_m > 0.0)) return {};
  const double dt_s = static_cast<double>(end_ns - begin_ns) * 1e-9;
  const glm::dvec3 shift_m = at(end_ns).pose.position_world_m - at(begin_ns).pose.position_world_m;
  const double straight_m = glm::length(shift_m);
  // A shift beyond the way holds a jump, so that its direction says nothing.
  if (straight_m > 1.001 * way_m) return {glm::dvec3(0.0), way_m / dt_s};
  return {shift_m / dt_s, std::sqrt(std::max(0.0, way_m * way_m - straight_m * straight_m)) / dt_s};
}

double PoseHistory::path_m(std::int64_t begin_ns, std::int64_t end_ns) const noexcept {
  if (live_.empty()) return path_in(scripted_, begin_ns, end_ns);
  // The entity may jump at the instant at which live poses replace the script.
  const std::int64_t seam_ns = live_.front().sim_time_ns;
  return path_in(scripted_, begin_ns, std::min(end_ns, seam_ns)) +
         path_in(live_, std::max(begin_ns, seam_ns), end_ns);
}

}  // namespace emit::renderer
