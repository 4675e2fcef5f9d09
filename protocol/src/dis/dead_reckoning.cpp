// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/dis/dead_reckoning.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

namespace emit::protocol::dis {
namespace {

/// Weights of the integrals over a turn by the angle th, each divided by the power of th with which
/// it vanishes. `a`, `b` and `c` belong to the identity, to S and to the outer product.
struct TurnWeights {
  double a1, b1, c1;  ///< of exp(S s)
  double a2, b2, c2;  ///< of s exp(S s)
};

/// Sum of the series that all weights have: (-1)^k th^(2k) / ((2k + first)! / ...), given by the
/// ratio of a term to the one in front.
template <class Ratio>
[[nodiscard]] double alternating_sum(double first, double square, Ratio&& ratio) noexcept {
  double sum = first;
  double term = first;
  // Below the angle of the caller the ninth term is beyond double precision.
  for (int k = 1; k <= 8; ++k) {
    term *= -square * ratio(static_cast<double>(k));
    sum += term;
  }
  return sum;
}

[[nodiscard]] TurnWeights turn_weights(double angle) noexcept {
  const double square = angle * angle;
  if (std::abs(angle) < 0.5) {
    return {
        .a1 = alternating_sum(1.0, square, [](double k) { return 1.0 / (2 * k * (2 * k + 1)); }),
        .b1 = alternating_sum(1.0 / 2, square,
                              [](double k) { return 1.0 / ((2 * k + 1) * (2 * k + 2)); }),
        .c1 = alternating_sum(1.0 / 6, square,
                              [](double k) { return 1.0 / ((2 * k + 2) * (2 * k + 3)); }),
        .a2 = alternating_sum(1.0 / 2, square,
                              [](double k) { return 1.0 / ((2 * k - 1) * (2 * k + 2)); }),
        .b2 =
            alternating_sum(1.0 / 3, square, [](double k) { return 1.0 / (2 * k * (2 * k + 3)); }),
        .c2 = alternating_sum(1.0 / 8, square,
                              [](double k) { return 1.0 / ((2 * k + 1) * (2 * k + 4)); }),
    };
  }
  const double sine = std::sin(angle);
  const double cosine = std::cos(angle);
  return {
      .a1 = sine / angle,
      .b1 = (1.0 - cosine) / square,
      .c1 = (angle - sine) / (square * angle),
      .a2 = (cosine + angle * sine - 1.0) / square,
      .b2 = (sine - angle * cosine) / (square * angle),
      .c2 = (square / 2 - cosine - angle * sine + 1.0) / (square * square),
  };
}

/// Returns a I v + b (w x v) + c w (w v), which is what every function of the cross-product matrix
/// of `w` does to a vector.
[[nodiscard]] glm::dvec3 combine(double a, double b, double c, const glm::dvec3& w,
                                 const glm::dvec3& v) noexcept {
  return a * v + b * glm::cross(w, v) + c * glm::dot(w, v) * w;
}

/// Returns the rotation exp(S t) of the angular velocity `w` (Rodrigues' formula).
[[nodiscard]] glm::dmat3 turn(const glm::dvec3& w, double t) noexcept {
  const double speed = glm::length(w);
  const double angle = speed * t;
  const TurnWeights weights = turn_weights(angle);
  glm::dmat3 rotation(1.0);
  for (int column = 0; column < 3; ++column) {
    glm::dvec3 unit(0.0);
    unit[column] = 1.0;
    rotation[column] = combine(std::cos(angle), weights.a1 * t, weights.b1 * t * t, w, unit);
  }
  return rotation;
}

[[nodiscard]] bool turns(DeadReckoningModel model) noexcept {
  using enum DeadReckoningModel;
  return model == rpw || model == rvw || model == rpb || model == rvb;
}
[[nodiscard]] bool accelerates(DeadReckoningModel model) noexcept {
  using enum DeadReckoningModel;
  return model == rvw || model == fvw || model == rvb || model == fvb;
}

}  // namespace

glm::dmat3 body_from_ecef(const EulerAngles& orientation) noexcept {
  const double psi = orientation.psi_rad;
  const double theta = orientation.theta_rad;
  const double phi = orientation.phi_rad;
  const double sp = std::sin(psi), cp = std::cos(psi);
  const double st = std::sin(theta), ct = std::cos(theta);
  const double sf = std::sin(phi), cf = std::cos(phi);
  // The columns are the ECEF axes in the body frame.
  return glm::dmat3(glm::dvec3(cp * ct, cp * st * sf - sp * cf, cp * st * cf + sp * sf),
                    glm::dvec3(sp * ct, sp * st * sf + cp * cf, sp * st * cf - cp * sf),
                    glm::dvec3(-st, ct * sf, ct * cf));
}

EulerAnglesF64 euler_angles(const glm::dmat3& body_from_ecef) noexcept {
  // m(row, column) is body_from_ecef[column][row].
  const auto& m = body_from_ecef;
  const double level = std::hypot(m[0][0], m[1][0]);
  const double theta = std::atan2(-m[2][0], level);
  if (level < 1e-9) {
    // Rows y and z hold only psi - phi or psi + phi; all of it goes to psi.
    return {std::atan2(-m[0][1], m[1][1]), theta, 0.0};
  }
  return {std::atan2(m[1][0], m[0][0]), theta, std::atan2(m[2][1], m[2][2])};
}

glm::dmat3 ecef_from_ned(const physics::GeoPlace& place) noexcept {
  const glm::dmat3 enu = physics::ecef_from_enu(place);
  return glm::dmat3(enu[1], enu[0], -enu[2]);
}

glm::dmat3 body_from_ned(const glm::dmat3& body_from_ecef,
                         const physics::GeoPlace& place) noexcept {
  return body_from_ecef * ecef_from_ned(place);
}

Motion motion_of(const EntityState& state) noexcept {
  return {.model = state.model,
          .position_ecef_m = state.location_ecef_m,
          .body_from_ecef = body_from_ecef(state.orientation),
          .velocity_m_s = glm::dvec3(state.velocity_m_s),
          .acceleration_m_s2 = glm::dvec3(state.acceleration_m_s2),
          .angular_velocity_rad_s = glm::dvec3(state.angular_velocity_rad_s)};
}

Predicted predict(const Motion& motion, double dt_s) noexcept {
  using enum DeadReckoningModel;
  Predicted out{.position_ecef_m = motion.position_ecef_m, .body_from_ecef = motion.body_from_ecef};
  if (motion.model == other || motion.model == stationary) return out;
  const double t = dt_s;
  const glm::dvec3 v = motion.velocity_m_s;
  const glm::dvec3 a = accelerates(motion.model) ? motion.acceleration_m_s2 : glm::dvec3(0.0);
  const glm::dvec3 w = turns(motion.model) ? motion.angular_velocity_rad_s : glm::dvec3(0.0);
  // The body turns by exp(S t), so that its view of the earth turns by the inverse.
  if (turns(motion.model)) out.body_from_ecef = turn(-w, t) * motion.body_from_ecef;

  const bool world_axes =
      motion.model == fpw || motion.model == rpw || motion.model == rvw || motion.model == fvw;
  if (world_axes) {
    out.position_ecef_m += v * t + a * (t * t / 2);
    out.velocity_ecef_m_s = v + a * t;
    return out;
  }
  const TurnWeights k = turn_weights(glm::length(w) * t);
  const double t2 = t * t;
  const glm::dvec3 moved_body_m = combine(k.a1 * t, k.b1 * t2, k.c1 * t2 * t, w, v) +
                                  combine(k.a2 * t2, k.b2 * t2 * t, k.c2 * t2 * t2, w, a);
  out.position_ecef_m += glm::transpose(motion.body_from_ecef) * moved_body_m;
  out.velocity_ecef_m_s = glm::transpose(out.body_from_ecef) * (v + a * t);
  return out;
}

}  // namespace emit::protocol::dis
