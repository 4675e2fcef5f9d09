// SPDX-License-Identifier: Apache-2.0
#include "gnss/truth_trajectory.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "emit/physics/check.hpp"
#include "gnss/local_fit.hpp"

namespace emit::server {
namespace {

using physics::ErrorCode;
using physics::make_error;

/// A fit reaches this far to both sides of its instant, or over this many poses.
constexpr std::int64_t kFitReachNs = 50'000'000;
constexpr std::size_t kFitPoses = 7;
constexpr std::size_t kPositionDegree = 5;
constexpr std::size_t kRateDegree = 4;
/// No seeker is faster, m/s: orbits around the earth are at most at 11 200 m/s.
constexpr double kFastestMS = 12'000.0;
/// A jump is told from a change of speed by this fraction of the way between two poses.
constexpr double kJumpWayFraction = 0.1;

double span_s(std::int64_t from_ns, std::int64_t to_ns) noexcept {
  return 1e-9 * static_cast<double>(to_ns - from_ns);
}

/// Returns the turn as a vector along its axis, the short way, rad.
glm::dvec3 turn_of(const glm::dquat& from, const glm::dquat& to) noexcept {
  glm::dquat turn = glm::conjugate(from) * to;
  if (turn.w < 0.0) turn = -turn;
  const glm::dvec3 axis_sine{turn.x, turn.y, turn.z};
  const double sine = glm::length(axis_sine);
  return axis_sine * (sine < 1e-12 ? 2.0 : 2.0 * std::atan2(sine, turn.w) / sine);
}

glm::dquat quaternion_of(const glm::dvec3& turn_rad) noexcept {
  const glm::dvec3 half = 0.5 * turn_rad;
  const double angle = glm::length(half);
  const double sinc = angle < 1e-9 ? 1.0 : std::sin(angle) / angle;
  return {std::cos(angle), half.x * sinc, half.y * sinc, half.z * sinc};
}

/// Returns the rate of the turn vector for a body rate at the turn: the inverse right Jacobian of
/// rotations (Bullo and Murray, ECC 1995).
glm::dvec3 turn_rate(const glm::dvec3& turn, const glm::dvec3& body_rate) noexcept {
  const double angle = glm::length(turn);
  const double c =
      angle < 1e-4 ? 1.0 / 12.0 : (1.0 - 0.5 * angle / std::tan(0.5 * angle)) / (angle * angle);
  const glm::dvec3 cross = glm::cross(turn, body_rate);
  return body_rate + 0.5 * cross + c * glm::cross(turn, cross);
}

std::string at_instant(std::size_t index, const TruthPose& pose) {
  return fmt::format("pose {} at {:.6f} s", index + 1,
                     1e-9 * static_cast<double>(pose.sim_time_ns));
}

bool same(const TruthPose& a, const TruthPose& b) noexcept {
  return a.pose.position_world_m == b.pose.position_world_m &&
         a.pose.world_from_body == b.pose.world_from_body;
}

/// Returns how far the way between two poses is from that of their velocities, m, less what a
/// change of velocity in between can explain.
double excess_with_rates_m(const TruthPose& a, const TruthPose& b) noexcept {
  const double h = span_s(a.sim_time_ns, b.sim_time_ns);
  const glm::dvec3& from = a.rates->velocity_world_m_s;
  const glm::dvec3& to = b.rates->velocity_world_m_s;
  const glm::dvec3 way = b.pose.position_world_m - a.pose.position_world_m;
  return glm::length(way - 0.5 * h * (from + to)) - 0.5 * h * glm::length(to - from) -
         kJumpWayFraction * h * std::max(glm::length(from), glm::length(to));
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

glm::dvec3 mean_velocity(const std::vector<TruthPose>& poses, std::size_t before) noexcept {
  const TruthPose& a = poses[before];
  const TruthPose& b = poses[before + 1];
  return (b.pose.position_world_m - a.pose.position_world_m) / span_s(a.sim_time_ns, b.sim_time_ns);
}

/// Returns the same from positions alone: how far the mean velocity between two poses stands out
/// from those of up to three spans to both sides, compared with how far these differ.
double excess_without_rates_m(const std::vector<TruthPose>& poses, std::size_t before) {
  constexpr std::size_t kNeighbours = 3;
  constexpr double kSpreads = 8.0;
  const std::size_t spans = poses.size() - 1;
  std::vector<glm::dvec3> around;
  for (std::size_t i = before - std::min(before, kNeighbours);
       i < std::min(spans, before + kNeighbours + 1); ++i) {
    if (i != before) around.push_back(mean_velocity(poses, i));
  }
  if (around.size() < 2) return 0.0;
  glm::dvec3 usual(0.0);
  for (glm::length_t axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    values.reserve(around.size());
    for (const glm::dvec3& velocity : around) values.push_back(velocity[axis]);
    usual[axis] = median(std::move(values));
  }
  std::vector<double> distances;
  distances.reserve(around.size());
  for (const glm::dvec3& velocity : around) distances.push_back(glm::length(velocity - usual));
  const double h = span_s(poses[before].sim_time_ns, poses[before + 1].sim_time_ns);
  return h * (glm::length(mean_velocity(poses, before) - usual) -
              kSpreads * median(std::move(distances)) - kJumpWayFraction * glm::length(usual));
}

physics::Result<void> check_order(const std::vector<TruthPose>& poses, const TruthLimits& limits) {
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const TruthPose& a = poses[i - 1];
    const TruthPose& b = poses[i];
    if (b.sim_time_ns < a.sim_time_ns) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("{} follows {}: time goes back, so that this is no single run",
                                    at_instant(i, b), at_instant(i - 1, a)));
    }
    if (b.sim_time_ns == a.sim_time_ns) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("{} and {} differ: the seeker jumps without time passing",
                                    at_instant(i - 1, a), at_instant(i, b)));
    }
    const double h = span_s(a.sim_time_ns, b.sim_time_ns);
    if (h > limits.max_gap_s) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("no pose for {:.3f} s between {} and {}: the longest gap is "
                                    "{:g} s (--max-gap-s)",
                                    h, at_instant(i - 1, a), at_instant(i, b), limits.max_gap_s));
    }
  }
  return {};
}

physics::Result<void> check_jumps(const std::vector<TruthPose>& poses, const TruthLimits& limits,
                                  bool has_rates) {
  for (std::size_t i = 0; i + 1 < poses.size(); ++i) {
    const TruthPose& a = poses[i];
    const TruthPose& b = poses[i + 1];
    const double speed_m_s = glm::length(mean_velocity(poses, i));
    if (speed_m_s > kFastestMS) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("a jump of {:.3f} m from {} to {}: that is {:.0f} m/s",
                                    glm::distance(a.pose.position_world_m, b.pose.position_world_m),
                                    at_instant(i, a), at_instant(i + 1, b), speed_m_s));
    }
    const double excess_m =
        has_rates ? excess_with_rates_m(a, b) : excess_without_rates_m(poses, i);
    if (excess_m > limits.max_jump_m) {
      return make_error(
          ErrorCode::invalid_argument,
          fmt::format("a jump of {:.3f} m from {} to {}: {} lead elsewhere, and a jump may be "
                      "{:g} m (--max-jump-m)",
                      glm::distance(a.pose.position_world_m, b.pose.position_world_m),
                      at_instant(i, a), at_instant(i + 1, b),
                      has_rates ? "their velocities" : "the poses around", limits.max_jump_m));
    }
  }
  return {};
}

}  // namespace

TruthTrajectory::TruthTrajectory(std::vector<TruthPose> poses)
    : poses_(std::move(poses)), has_rates_(std::ranges::all_of(poses_, [](const TruthPose& pose) {
        return pose.rates.has_value();
      })) {}

physics::Result<TruthTrajectory> TruthTrajectory::create(std::vector<TruthPose> poses,
                                                         const TruthLimits& limits) {
  const auto twice = std::unique(poses.begin(), poses.end(), [](const auto& a, const auto& b) {
    return a.sim_time_ns == b.sim_time_ns && same(a, b);
  });
  poses.erase(twice, poses.end());
  if (poses.size() < 2) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{} poses make no trajectory, two do", poses.size()));
  }
  for (TruthPose& pose : poses) {
    pose.pose.world_from_body = glm::normalize(pose.pose.world_from_body);
  }
  if (auto ordered = check_order(poses, limits); !ordered) {
    return tl::unexpected(ordered.error());
  }
  TruthTrajectory out(std::move(poses));
  if (auto steady = check_jumps(out.poses_, limits, out.has_rates_); !steady) {
    return tl::unexpected(steady.error());
  }
  return out;
}

std::pair<std::size_t, std::size_t> TruthTrajectory::window(
    std::int64_t sim_time_ns) const noexcept {
  // A window at an end of the log is as long as one within, so that its fit is as steady.
  std::int64_t from_ns = std::max(first_ns(), sim_time_ns - kFitReachNs);
  const std::int64_t to_ns = std::min(last_ns(), from_ns + 2 * kFitReachNs);
  from_ns = std::max(first_ns(), std::min(from_ns, to_ns - 2 * kFitReachNs));
  const auto index_of = [this](auto found) {
    return static_cast<std::size_t>(found - poses_.begin());
  };
  std::size_t first =
      index_of(std::ranges::lower_bound(poses_, from_ns, {}, &TruthPose::sim_time_ns));
  // The last pose of the window is the one before the first that lies behind it.
  std::size_t end = index_of(std::ranges::upper_bound(poses_, to_ns, {}, &TruthPose::sim_time_ns));
  while (end - first < std::min(kFitPoses, poses_.size())) {
    // The nearer neighbour joins.
    const bool before = first > 0;
    const bool behind = end < poses_.size();
    if (before && (!behind || sim_time_ns - poses_[first - 1].sim_time_ns <=
                                  poses_[end].sim_time_ns - sim_time_ns)) {
      --first;
    } else {
      ++end;
    }
  }
  return {first, end - 1};
}

TruthTrajectory::Motion TruthTrajectory::translation(std::int64_t sim_time_ns) const {
  const auto [first, last] = window(sim_time_ns);
  std::vector<FitSample> samples;
  samples.reserve(last - first + 1);
  for (std::size_t i = first; i <= last; ++i) {
    samples.push_back(
        {span_s(sim_time_ns, poses_[i].sim_time_ns),
         has_rates_ ? poses_[i].rates->velocity_world_m_s
                    : poses_[i].pose.position_world_m - poses_[first].pose.position_world_m});
  }
  const auto fit = fit_at(samples, has_rates_ ? kRateDegree : kPositionDegree, 0.0);
  if (has_rates_) return {fit[0], fit[1], fit[2]};
  return {fit[1], fit[2], fit[3]};
}

TruthTrajectory::Motion TruthTrajectory::rotation(std::int64_t sim_time_ns) const {
  const auto [first, last] = window(sim_time_ns);
  std::vector<FitSample> samples;
  samples.reserve(last - first + 1);
  for (std::size_t i = first; i <= last; ++i) {
    if (has_rates_) {
      samples.push_back(
          {span_s(sim_time_ns, poses_[i].sim_time_ns), poses_[i].rates->angular_rate_body_rad_s});
    } else if (i < last) {
      const TruthPose& a = poses_[i];
      const TruthPose& b = poses_[i + 1];
      samples.push_back(
          {0.5 * (span_s(sim_time_ns, a.sim_time_ns) + span_s(sim_time_ns, b.sim_time_ns)),
           turn_of(a.pose.world_from_body, b.pose.world_from_body) /
               span_s(a.sim_time_ns, b.sim_time_ns)});
    }
  }
  const auto fit = fit_at(samples, kRateDegree, 0.0);
  return {fit[0], fit[1], fit[2]};
}

glm::dvec3 TruthTrajectory::position(std::size_t before, std::int64_t sim_time_ns) const {
  const TruthPose& a = poses_[before];
  const TruthPose& b = poses_[before + 1];
  const double h = span_s(a.sim_time_ns, b.sim_time_ns);
  const double s = span_s(a.sim_time_ns, sim_time_ns) / h;
  const Motion from = translation(a.sim_time_ns);
  const Motion to = translation(b.sim_time_ns);
  const glm::dvec3 v0 = h * (has_rates_ ? a.rates->velocity_world_m_s : from.first);
  const glm::dvec3 v1 = h * (has_rates_ ? b.rates->velocity_world_m_s : to.first);
  const glm::dvec3 a0 = h * h * from.second;
  const glm::dvec3 a1 = h * h * to.second;
  // Coefficients of the quintic that has these values at both ends, about the pose before.
  const glm::dvec3 way = b.pose.position_world_m - a.pose.position_world_m;
  const glm::dvec3 c3 = 10.0 * way - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1;
  const glm::dvec3 c4 = -15.0 * way + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1;
  const glm::dvec3 c5 = 6.0 * way - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1;
  return a.pose.position_world_m + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))));
}

glm::dquat TruthTrajectory::attitude(std::size_t before, std::int64_t sim_time_ns) const {
  const TruthPose& a = poses_[before];
  const TruthPose& b = poses_[before + 1];
  const double h = span_s(a.sim_time_ns, b.sim_time_ns);
  const double s = span_s(a.sim_time_ns, sim_time_ns) / h;
  const glm::dvec3 turn = turn_of(a.pose.world_from_body, b.pose.world_from_body);
  const glm::dvec3 from =
      h * (has_rates_ ? a.rates->angular_rate_body_rad_s : rotation(a.sim_time_ns).first);
  const glm::dvec3 to = h * turn_rate(turn, has_rates_ ? b.rates->angular_rate_body_rad_s
                                                       : rotation(b.sim_time_ns).first);
  // The cubic that has these rates at both ends.
  const glm::dvec3 c2 = 3.0 * turn - 2.0 * from - to;
  const glm::dvec3 c3 = from + to - 2.0 * turn;
  return glm::normalize(a.pose.world_from_body * quaternion_of(s * (from + s * (c2 + s * c3))));
}

TruthState TruthTrajectory::at(std::int64_t sim_time_ns) const {
  EMIT_CHECK_OP(sim_time_ns, >=, first_ns());
  EMIT_CHECK_OP(sim_time_ns, <=, last_ns());
  const auto behind = std::ranges::upper_bound(poses_, sim_time_ns, {}, &TruthPose::sim_time_ns);
  const std::size_t before =
      std::min(static_cast<std::size_t>(behind - poses_.begin()), poses_.size() - 1) - 1;
  TruthState out;
  out.pose.position_world_m = position(before, sim_time_ns);
  out.pose.world_from_body = attitude(before, sim_time_ns);
  const Motion moved = translation(sim_time_ns);
  out.velocity_m_s = moved.first;
  out.acceleration_m_s2 = moved.second;
  out.jerk_m_s3 = moved.third;
  const Motion turned = rotation(sim_time_ns);
  out.angular_rate_rad_s = turned.first;
  out.angular_acceleration_rad_s2 = turned.second;
  out.angular_jerk_rad_s3 = turned.third;
  return out;
}

}  // namespace emit::server
