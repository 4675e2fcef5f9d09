// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <random>

#include "emit/protocol/dis.hpp"

namespace emit::protocol::dis {
namespace {

using Vec = glm::dvec3;
using Mat = glm::dmat3;
constexpr double kPi = std::numbers::pi;

double distance_of(const Mat& a, const Mat& b) {
  double worst = 0.0;
  for (int c = 0; c < 3; ++c) worst = std::max(worst, glm::length(a[c] - b[c]));
  return worst;
}

/// Rotations about single axes, written from their definition: they turn the axes, so that a vector
/// gets the components in the turned frame.
Mat about_x(double angle) {
  return glm::transpose(Mat(Vec(1, 0, 0), Vec(0, std::cos(angle), std::sin(angle)),
                            Vec(0, -std::sin(angle), std::cos(angle))));
}
Mat about_y(double angle) {
  return glm::transpose(Mat(Vec(std::cos(angle), 0, -std::sin(angle)), Vec(0, 1, 0),
                            Vec(std::sin(angle), 0, std::cos(angle))));
}
Mat about_z(double angle) {
  return glm::transpose(Mat(Vec(std::cos(angle), std::sin(angle), 0),
                            Vec(-std::sin(angle), std::cos(angle), 0), Vec(0, 0, 1)));
}

/// Integrates the motion by Runge and Kutta's rule of fourth order: the attitude turns with the
/// body's rates, and the velocity follows the rule of the model. It shares no formula with the
/// library: no Rodrigues, no integrals.
Predicted integrated(const Motion& m, double dt_s, int steps) {
  using enum DeadReckoningModel;
  const bool rotating = m.model == rpw || m.model == rvw || m.model == rpb || m.model == rvb;
  const bool second = m.model == rvw || m.model == fvw || m.model == rvb || m.model == fvb;
  const bool body = m.model == fpb || m.model == rpb || m.model == rvb || m.model == fvb;
  struct State {
    Vec position;
    Mat ecef_from_body;
  };
  const auto rate = [&](const State& s, double t) {
    const Vec own = m.velocity_m_s + (second ? m.acceleration_m_s2 * t : Vec(0.0));
    State out{body ? s.ecef_from_body * own : own, Mat(0.0)};
    if (rotating) {
      // A column is a body axis in ECEF; it moves with omega x axis, omega being along body axes.
      const Vec omega_ecef = s.ecef_from_body * m.angular_velocity_rad_s;
      for (int c = 0; c < 3; ++c)
        out.ecef_from_body[c] = glm::cross(omega_ecef, s.ecef_from_body[c]);
    }
    return out;
  };
  const auto moved = [](const State& s, const State& r, double h) {
    return State{s.position + r.position * h, s.ecef_from_body + r.ecef_from_body * h};
  };
  // Sums of small steps onto millions of metres would lose digits, so that the way is summed.
  State s{Vec(0.0), glm::transpose(m.body_from_ecef)};
  const double h = dt_s / steps;
  for (int i = 0; i < steps; ++i) {
    const double t = i * h;
    const State k1 = rate(s, t);
    const State k2 = rate(moved(s, k1, h / 2), t + h / 2);
    const State k3 = rate(moved(s, k2, h / 2), t + h / 2);
    const State k4 = rate(moved(s, k3, h), t + h);
    s = moved(moved(moved(moved(s, k1, h / 6), k2, h / 3), k3, h / 3), k4, h / 6);
  }
  const State end = rate(s, dt_s);
  return {m.position_ecef_m + s.position, end.position, glm::transpose(s.ecef_from_body)};
}

Motion sample_motion(DeadReckoningModel model) {
  return {.model = model,
          .position_ecef_m = {4331297.0, 567537.5, 4633133.25},
          .body_from_ecef = body_from_ecef({1.1f, -0.4f, 2.2f}),
          .velocity_m_s = {250.0, -30.0, 12.0},
          .acceleration_m_s2 = {9.0, -20.0, 4.0},
          .angular_velocity_rad_s = {0.9, -0.7, 1.3}};
}

TEST(DisFrames, EulerAnglesAreThreeTurnsOfTheAxes) {
  for (const double psi : {-3.0, -0.5, 0.0, 1.2}) {
    for (const double theta : {-1.4, 0.0, 0.7}) {
      for (const double phi : {-2.9, 0.3, 3.1}) {
        const EulerAngles angles{static_cast<float>(psi), static_cast<float>(theta),
                                 static_cast<float>(phi)};
        const Mat expected =
            about_x(angles.phi_rad) * about_y(angles.theta_rad) * about_z(angles.psi_rad);
        const Mat matrix = body_from_ecef(angles);
        EXPECT_LT(distance_of(matrix, expected), 1e-15);
        const auto back = euler_angles(matrix);
        EXPECT_NEAR(back.psi_rad, angles.psi_rad, 1e-12);
        EXPECT_NEAR(back.theta_rad, angles.theta_rad, 1e-12);
        EXPECT_NEAR(back.phi_rad, angles.phi_rad, 1e-12);
      }
    }
  }
}

TEST(DisFrames, AVerticalAxisHasNoPhi) {
  for (const double sign : {-1.0, 1.0}) {
    const Mat matrix = about_x(0.4) * about_y(sign * kPi / 2) * about_z(1.1);
    const auto angles = euler_angles(matrix);
    EXPECT_NEAR(angles.theta_rad, sign * kPi / 2, 1e-7);
    EXPECT_EQ(angles.phi_rad, 0.0);
    EXPECT_NEAR(angles.psi_rad, 1.1 - sign * 0.4, 1e-7);
  }
}

TEST(DisFrames, LevelFlightHasItsHeadingAgainstNorthEastDown) {
  const physics::GeoPlace place{physics::Radians(47.0 * kPi / 180),
                                physics::Radians(8.0 * kPi / 180), physics::Metres(1000.0)};
  // The attitude is built from the axes: the nose points to the heading, the z axis down.
  const Mat ned = ecef_from_ned(place);
  EXPECT_LT(
      glm::length(ned[2] + glm::normalize(Vec(
                               std::cos(place.latitude.value()) * std::cos(place.longitude.value()),
                               std::cos(place.latitude.value()) * std::sin(place.longitude.value()),
                               std::sin(place.latitude.value())))),
      1e-12);
  EXPECT_LT(std::abs(ned[1].z), 1e-15) << "east is along the equator's plane";
  EXPECT_GT(ned[0].z, 0.0) << "north goes towards the pole";
  EXPECT_LT(glm::length(glm::cross(ned[0], ned[1]) - ned[2]), 1e-15);
  for (const double heading : {-2.5, 0.0, 0.3, 3.0}) {
    const Vec nose = ned[0] * std::cos(heading) + ned[1] * std::sin(heading);
    const Vec right = -ned[0] * std::sin(heading) + ned[1] * std::cos(heading);
    const Mat attitude = glm::transpose(Mat(nose, right, ned[2]));
    const auto angles = euler_angles(body_from_ned(attitude, place));
    EXPECT_NEAR(angles.psi_rad, heading, 1e-12);
    EXPECT_NEAR(angles.theta_rad, 0.0, 1e-12);
    EXPECT_NEAR(angles.phi_rad, 0.0, 1e-12);
  }
}

TEST(DisDeadReckoning, EveryModelAgreesWithNumericalIntegration) {
  for (int model = 0; model <= 9; ++model) {
    Motion motion = sample_motion(static_cast<DeadReckoningModel>(model));
    if (model < 2) motion.velocity_m_s = Vec(0.0);
    for (const double dt_s : {-1.5, -0.01, 0.0, 0.02, 0.3, 5.0}) {
      const Predicted got = predict(motion, dt_s);
      const Predicted expected = integrated(motion, dt_s, 4000);
      EXPECT_LT(glm::length(got.position_ecef_m - expected.position_ecef_m), 1e-7)
          << model << ' ' << dt_s;
      EXPECT_LT(glm::length(got.velocity_ecef_m_s - expected.velocity_ecef_m_s), 1e-7)
          << model << ' ' << dt_s;
      EXPECT_LT(distance_of(got.body_from_ecef, expected.body_from_ecef), 1e-9)
          << model << ' ' << dt_s;
    }
  }
}

TEST(DisDeadReckoning, StationaryAndOtherStandStillWhateverTheirNumbers) {
  for (const auto model : {DeadReckoningModel::other, DeadReckoningModel::stationary}) {
    const Motion motion = sample_motion(model);
    const Predicted got = predict(motion, 3.0);
    EXPECT_EQ(got.position_ecef_m, motion.position_ecef_m);
    EXPECT_EQ(got.velocity_ecef_m_s, Vec(0.0));
    EXPECT_EQ(got.body_from_ecef, motion.body_from_ecef);
  }
}

TEST(DisDeadReckoning, ATurnAtConstantSpeedIsACircle) {
  // Body x is along ECEF x, and the body turns about its z axis. After a full turn it is back, and
  // half a turn away it is a diameter to the side: 2 v / omega along +y.
  Motion motion{.model = DeadReckoningModel::rpb,
                .velocity_m_s = {300.0, 0.0, 0.0},
                .angular_velocity_rad_s = {0.0, 0.0, 0.5}};
  const Predicted half = predict(motion, kPi / 0.5);
  EXPECT_LT(glm::length(half.position_ecef_m - Vec(0.0, 1200.0, 0.0)), 1e-9);
  EXPECT_LT(glm::length(half.velocity_ecef_m_s - Vec(-300.0, 0.0, 0.0)), 1e-9);
  const Predicted full = predict(motion, 2 * kPi / 0.5);
  EXPECT_LT(glm::length(full.position_ecef_m), 1e-9);
  EXPECT_LT(distance_of(full.body_from_ecef, Mat(1.0)), 1e-12);
  const Predicted quarter = predict(motion, kPi / 2 / 0.5);
  EXPECT_LT(glm::length(quarter.position_ecef_m - Vec(600.0, 600.0, 0.0)), 1e-9);
  // Body x now points along ECEF y.
  EXPECT_LT(glm::length(glm::transpose(quarter.body_from_ecef) * Vec(1, 0, 0) - Vec(0, 1, 0)),
            1e-12);
}

TEST(DisDeadReckoning, FixedModelsIgnoreTheirRates) {
  for (const auto& [fixed, world] : {std::pair(DeadReckoningModel::fpb, DeadReckoningModel::fpw),
                                     std::pair(DeadReckoningModel::fvb, DeadReckoningModel::fvw)}) {
    const Motion body = sample_motion(fixed);
    Motion straight = sample_motion(world);
    straight.velocity_m_s = glm::transpose(body.body_from_ecef) * body.velocity_m_s;
    straight.acceleration_m_s2 = glm::transpose(body.body_from_ecef) * body.acceleration_m_s2;
    const Predicted got = predict(body, 4.0);
    const Predicted expected = predict(straight, 4.0);
    EXPECT_LT(glm::length(got.position_ecef_m - expected.position_ecef_m), 1e-8);
    EXPECT_LT(glm::length(got.velocity_ecef_m_s - expected.velocity_ecef_m_s), 1e-10);
    EXPECT_EQ(got.body_from_ecef, body.body_from_ecef);
  }
}

TEST(DisDeadReckoning, ModelsOfFirstOrderIgnoreTheirAcceleration) {
  for (const auto model : {DeadReckoningModel::fpw, DeadReckoningModel::rpw,
                           DeadReckoningModel::fpb, DeadReckoningModel::rpb}) {
    Motion motion = sample_motion(model);
    const Predicted with = predict(motion, 2.0);
    motion.acceleration_m_s2 = Vec(0.0);
    EXPECT_EQ(with.position_ecef_m, predict(motion, 2.0).position_ecef_m);
  }
}

TEST(DisDeadReckoning, SmallRatesJoinTheStraightLineWithoutAStep) {
  // The series takes over at an angle of 0.5: both sides of it, and rates down to nothing, agree
  // with an integration that knows no series.
  for (const auto model : {DeadReckoningModel::rpb, DeadReckoningModel::rvb}) {
    Motion motion = sample_motion(model);
    const Vec direction = glm::normalize(motion.angular_velocity_rad_s);
    for (const double rate :
         {0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3, 0.1, 0.2499999, 0.2500001, 0.26}) {
      motion.angular_velocity_rad_s = direction * rate;
      const Predicted got = predict(motion, 2.0);
      const Predicted expected = integrated(motion, 2.0, 2000);
      EXPECT_LT(glm::length(got.position_ecef_m - expected.position_ecef_m), 1e-7) << rate;
      EXPECT_LT(distance_of(got.body_from_ecef, expected.body_from_ecef), 1e-11) << rate;
    }
  }
}

TEST(DisDeadReckoning, TheBodysAccelerationHasNoPartOfTheTurn) {
  // A coordinated turn whose body velocity stays the same has an acceleration of omega x V in
  // space. In our reading Ab is 0 then, and model 8 gives what model 7 gives.
  Motion turn = sample_motion(DeadReckoningModel::rvb);
  turn.acceleration_m_s2 = Vec(0.0);
  Motion plain = turn;
  plain.model = DeadReckoningModel::rpb;
  EXPECT_EQ(predict(turn, 3.0).position_ecef_m, predict(plain, 3.0).position_ecef_m);
}

TEST(DisDeadReckoning, PredictionsInTwoStepsMeet) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  for (int i = 0; i < 200; ++i) {
    Motion motion = sample_motion(i % 2 == 0 ? DeadReckoningModel::rvb : DeadReckoningModel::rvw);
    motion.angular_velocity_rad_s = Vec(number(random), number(random), number(random)) * 3.0;
    const double first_s = 1.0 + number(random);
    const double second_s = 1.0 + number(random);
    const Predicted half = predict(motion, first_s);
    Motion rest = motion;
    rest.position_ecef_m = half.position_ecef_m;
    rest.body_from_ecef = half.body_from_ecef;
    rest.velocity_m_s += motion.acceleration_m_s2 * first_s;
    const Predicted two = predict(rest, second_s);
    const Predicted one = predict(motion, first_s + second_s);
    EXPECT_LT(glm::length(two.position_ecef_m - one.position_ecef_m), 1e-7);
    EXPECT_LT(distance_of(two.body_from_ecef, one.body_from_ecef), 1e-12);
  }
}

TEST(DisDeadReckoning, MotionTakesTheNumbersOfThePdu) {
  EntityState state;
  state.model = DeadReckoningModel::rvw;
  state.location_ecef_m = {1.0, 2.0, 3.0};
  state.velocity_m_s = {4.0f, 5.0f, 6.0f};
  state.acceleration_m_s2 = {7.0f, 8.0f, 9.0f};
  state.angular_velocity_rad_s = {0.1f, 0.2f, 0.3f};
  state.orientation = {0.4f, 0.5f, 0.6f};
  const Motion motion = motion_of(state);
  EXPECT_EQ(motion.model, DeadReckoningModel::rvw);
  EXPECT_EQ(motion.position_ecef_m, Vec(1.0, 2.0, 3.0));
  EXPECT_EQ(motion.velocity_m_s, Vec(4.0, 5.0, 6.0));
  EXPECT_EQ(motion.acceleration_m_s2, Vec(7.0, 8.0, 9.0));
  EXPECT_EQ(motion.angular_velocity_rad_s, Vec(glm::vec3(0.1f, 0.2f, 0.3f)));
  EXPECT_EQ(motion.body_from_ecef, body_from_ecef(state.orientation));
}

}  // namespace
}  // namespace emit::protocol::dis
