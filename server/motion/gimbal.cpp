// SPDX-License-Identifier: Apache-2.0
#include "motion/gimbal.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <utility>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"

namespace emit::server {
namespace {

using physics::kPi;

/// Cosine of the middle angle below which a gimbal is near lock: 5 degrees from it.
constexpr double kNearLock = 0.0872;
/// Cosine below which the angles of the outer and the inner ring cannot be told apart.
constexpr double kLock = 1e-9;
/// Damping of rates in gimbal lock. It begins with 0 at kNearLock, so that rates are continuous.
constexpr double kDamping = 0.05;

/// Returns the rotation about axis 0, 1 or 2.
glm::dmat3 rotation(glm::length_t axis, double angle_rad) noexcept {
  const glm::length_t b = (axis + 1) % 3;
  const glm::length_t c = (axis + 2) % 3;
  const double cosine = std::cos(angle_rad);
  const double sine = std::sin(angle_rad);
  glm::dmat3 out(1.0);
  out[b][b] = cosine;
  out[b][c] = sine;  // column b, row c
  out[c][b] = -sine;
  out[c][c] = cosine;
  return out;
}

glm::dvec3 unit(glm::length_t axis) noexcept {
  glm::dvec3 out(0.0);
  out[axis] = 1.0;
  return out;
}

/// Returns the angle plus the number of full turns that brings it nearest to `near_rad`.
double unwrapped(double angle_rad, double near_rad) noexcept {
  return angle_rad + 2.0 * kPi * std::round((near_rad - angle_rad) / (2.0 * kPi));
}

double farthest(const glm::dvec3& a, const glm::dvec3& b) noexcept {
  const glm::dvec3 d = glm::abs(a - b);
  return std::max({d.x, d.y, d.z});
}

/// Returns x with a x = b, damped where `a` is nearly singular: the least of |a x - b|^2 +
/// (damping x)^2. `conditioning` is |det a|.
glm::dvec3 solve_damped(const glm::dmat3& a, const glm::dvec3& b, double conditioning) noexcept {
  if (conditioning >= kNearLock) return glm::inverse(a) * b;
  const double share = conditioning / kNearLock;
  const double damping2 = kDamping * kDamping * (1.0 - share * share);
  const glm::dmat3 transposed = glm::transpose(a);
  return glm::inverse(transposed * a + glm::dmat3(damping2)) * (transposed * b);
}

/// Quantity with its first two derivatives in time.
struct Jet {
  double value = 0.0;
  double first = 0.0;
  double second = 0.0;
};

Jet square(const Jet& x) noexcept {
  return {x.value * x.value, 2.0 * x.value * x.first,
          2.0 * (x.first * x.first + x.value * x.second)};
}
Jet sum(const Jet& x, const Jet& y) noexcept {
  return {x.value + y.value, x.first + y.first, x.second + y.second};
}
/// @pre x.value > 0
Jet square_root(const Jet& x) noexcept {
  const double root = std::sqrt(x.value);
  const double first = 0.5 * x.first / root;
  return {root, first, (0.5 * x.second - first * first) / root};
}
/// Returns atan2(y, x), with d/dt = (x y' - y x') / (x^2 + y^2).
AxisMotion angle_of(const Jet& y, const Jet& x) noexcept {
  const double length2 = x.value * x.value + y.value * y.value;
  const double turn = x.value * y.first - y.value * x.first;
  const double turn_change = x.value * y.second - y.value * x.second;
  const double length2_change = 2.0 * (x.value * x.first + y.value * y.first);
  return {std::atan2(y.value, x.value), turn / length2,
          (turn_change * length2 - turn * length2_change) / (length2 * length2)};
}

}  // namespace

physics::Result<ThreeAxisGimbal> ThreeAxisGimbal::create(std::array<GimbalAxis, 3> outer_to_inner) {
  std::array<glm::length_t, 3> axes{};
  for (std::size_t i = 0; i < 3; ++i) axes[i] = static_cast<glm::length_t>(outer_to_inner[i]);
  if (axes[0] == axes[1] || axes[1] == axes[2] || axes[0] == axes[2]) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               "two rings of a gimbal turn about the same axis");
  }
  return ThreeAxisGimbal(axes, (axes[0] + 1) % 3 == axes[1] ? 1.0 : -1.0);
}

glm::dmat3 ThreeAxisGimbal::base_from_payload(const glm::dvec3& angles_rad) const noexcept {
  return rotation(axes_[0], angles_rad.x) * rotation(axes_[1], angles_rad.y) *
         rotation(axes_[2], angles_rad.z);
}

glm::dvec3 ThreeAxisGimbal::angles_rad(const glm::dmat3& base_from_payload,
                                       const glm::dvec3& near_rad) const noexcept {
  const glm::length_t i = axes_[0];
  const glm::length_t j = axes_[1];
  const glm::length_t k = axes_[2];
  const auto at = [&](glm::length_t row, glm::length_t column) {
    return base_from_payload[column][row];
  };
  const double sine = parity_ * at(i, k);
  const double cosine = std::hypot(at(i, i), at(i, j));
  // Take both solutions: the cosine of the middle angle is positive or negative.
  const auto solution = [&](double sign) {
    glm::dvec3 out;
    out.y = unwrapped(std::atan2(sine, sign * cosine), near_rad.y);
    if (cosine > kLock) {
      out.x = unwrapped(std::atan2(-sign * parity_ * at(j, k), sign * at(k, k)), near_rad.x);
      out.z = unwrapped(std::atan2(-sign * parity_ * at(i, j), sign * at(i, i)), near_rad.z);
      return out;
    }
    // Leave the outer ring in lock and turn the inner one: with the outer ring turned back,
    // R2(b) R3(c) remains, whose row of axis j is that of R3(c).
    out.x = near_rad.x;
    const glm::dmat3 rest = rotation(i, -out.x) * base_from_payload;
    out.z = unwrapped(std::atan2(parity_ * rest[i][j], rest[j][j]), near_rad.z);
    return out;
  };
  const glm::dvec3 front = solution(1.0);
  const glm::dvec3 over = solution(-1.0);
  return farthest(front, near_rad) <= farthest(over, near_rad) ? front : over;
}

glm::dmat3 ThreeAxisGimbal::ring_axes(const glm::dvec3& angles_rad) const noexcept {
  const glm::dmat3 payload_from_inner = rotation(axes_[2], -angles_rad.z);
  const glm::dmat3 payload_from_middle = payload_from_inner * rotation(axes_[1], -angles_rad.y);
  return {payload_from_middle * unit(axes_[0]), payload_from_inner * unit(axes_[1]),
          unit(axes_[2])};
}

glm::dvec3 ThreeAxisGimbal::angular_velocity_rad_s(const glm::dvec3& angles_rad,
                                                   const glm::dvec3& rates_rad_s) const noexcept {
  return ring_axes(angles_rad) * rates_rad_s;
}

ThreeAxisGimbal::Motion ThreeAxisGimbal::motion(const glm::dmat3& base_from_payload,
                                                const glm::dvec3& angular_velocity_rad_s,
                                                const glm::dvec3& angular_acceleration_rad_s2,
                                                const glm::dvec3& near_rad) const noexcept {
  const glm::dvec3 angles = angles_rad(base_from_payload, near_rad);
  const double conditioning = std::abs(std::cos(angles.y));
  const glm::dmat3 axes = ring_axes(angles);
  const glm::dvec3 rates = solve_damped(axes, angular_velocity_rad_s, conditioning);
  // The axis of a ring is fixed in the ring around it. The payload turns relative to that by the
  // rings inside, so that the axis turns the other way round in axes of the payload.
  const glm::dvec3 inner_rate = rates.z * axes[2];
  const glm::dvec3 middle_rate = inner_rate + rates.y * axes[1];
  const glm::dvec3 axes_change =
      -rates.x * glm::cross(middle_rate, axes[0]) - rates.y * glm::cross(inner_rate, axes[1]);
  const glm::dvec3 accelerations =
      solve_damped(axes, angular_acceleration_rad_s2 - axes_change, conditioning);
  Motion out;
  out.near_lock = conditioning < kNearLock;
  for (glm::length_t ring = 0; ring < 3; ++ring) {
    out.rings[static_cast<std::size_t>(ring)] = {angles[ring], rates[ring], accelerations[ring]};
  }
  return out;
}

glm::dmat3 TwoAxisGimbal::base_from_payload(double azimuth_rad,
                                            double elevation_rad) const noexcept {
  const glm::dmat3 azimuth = rotation(2, azimuth_rad);
  const glm::dmat3 elevation = rotation(1, elevation_rad);
  return outer_ == Outer::azimuth ? azimuth * elevation : elevation * azimuth;
}

TwoAxisGimbal::Motion TwoAxisGimbal::motion(const glm::dvec3& target_m,
                                            const glm::dvec3& velocity_m_s,
                                            const glm::dvec3& acceleration_m_s2,
                                            const Motion& near) const noexcept {
  const double distance_m = glm::length(target_m);
  EMIT_DCHECK_OP(distance_m, >, 0.0);
  const auto along = [&](glm::length_t axis, double sign) {
    return Jet{sign * target_m[axis] / distance_m, sign * velocity_m_s[axis] / distance_m,
               sign * acceleration_m_s2[axis] / distance_m};
  };
  const bool azimuth_outer = outer_ == Outer::azimuth;
  const Jet ahead = along(0, 1.0);
  const Jet right = along(1, 1.0);
  const Jet up = along(2, -1.0);
  const Jet& outer_side = azimuth_outer ? right : up;
  const Jet& inner_side = azimuth_outer ? up : right;
  const AxisMotion& near_outer = azimuth_outer ? near.azimuth : near.elevation;
  const Jet reach2 = sum(square(ahead), square(outer_side));
  // Leave the outer ring where it is when the target stands on its axis.
  AxisMotion outer{near_outer.angle_rad, 0.0, 0.0};
  AxisMotion inner{std::copysign(0.5 * kPi, inner_side.value), 0.0, 0.0};
  if (reach2.value > kLock * kLock) {
    outer = angle_of(outer_side, ahead);
    outer.angle_rad = unwrapped(outer.angle_rad, near_outer.angle_rad);
    inner = angle_of(inner_side, square_root(reach2));
  }
  Motion out;
  out.azimuth = azimuth_outer ? outer : inner;
  out.elevation = azimuth_outer ? inner : outer;
  out.near_lock = reach2.value < kNearLock * kNearLock;
  // Damp the outer ring near its lock: its rate grows as 1 / reach and its acceleration faster.
  if (out.near_lock) {
    AxisMotion& ring = azimuth_outer ? out.azimuth : out.elevation;
    const double share = reach2.value / (kNearLock * kNearLock);
    ring.rate_rad_s *= share;
    ring.acceleration_rad_s2 *= share;
  }
  return out;
}

}  // namespace emit::server
